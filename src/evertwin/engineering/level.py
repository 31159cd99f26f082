"""How deeply each component is modelled: white, grey or black; and what data is missing for it.

* **white**: the component is critical, and the data for a detailed model exists;
* **grey**: some is missing and a physical law completes it, or no detail is asked for;
* **black**: its inner working is not known, or of no interest.

>>> from evertwin.engineering.parts import Component, DataPart
>>> gearbox = Component("gearbox", data=(DataPart("kinematic", "catalogue", "ratio"),),
...                     physics="friction law", sensors=("torque",))
>>> choice = level_of(gearbox, "critical")
>>> choice.level, choice.missing[0].kind
('grey', 'dynamic')
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from evertwin.engineering.parts import Component, Level, Role

HOW = {
    "structural": "weigh and measure it, or take it from the CAD file",
    "kinematic": "read it in the manual or off the name plate, or count turns by hand",
    "dynamic": "catalogue of its maker, literature on like parts, or an experiment",
}


class Missing(NamedTuple):
    """Data that a model of this depth would need.

    >>> Missing("initial value", "Fc", "literature").what
    'Fc'
    """

    kind: str
    """structural, kinematic, dynamic, or initial value."""
    what: str
    how: str
    """How to get it."""


@dataclass(frozen=True)
class LevelChoice:
    """The depth of one component's model.

    >>> LevelChoice("hose", "black", "black", "of no interest").missing
    ()
    """

    component: str
    level: Level
    """What counts: recommended or overridden."""
    recommended: Level
    reason: str
    missing: tuple[Missing, ...] = ()
    overridden: str = ""
    """The engineer's reason; empty: not overridden."""


def level_of(part: Component, role: Role) -> LevelChoice:
    """The recommended depth, or the engineer's own."""
    missing = _missing(part)
    recommended, reason = _recommended(part, role, [m for m in missing if m.kind in HOW])
    override = part.override
    if override is None or override.level is None:
        return LevelChoice(part.name, recommended, recommended, reason, missing)
    told = f"{reason}; overridden from {recommended} to {override.level}: {override.reason}"
    return LevelChoice(part.name, override.level, recommended, told, missing, override.reason)


def _recommended(part: Component, role: Role, missing: list[Missing]) -> tuple[Level, str]:
    if not part.interest:
        return "black", "its inner working is of no interest to the study"
    named = ", ".join(m.kind for m in missing)
    known = ", ".join(f"{d.what or d.kind} ({d.source})" for d in part.data)
    if not missing:
        if role == "critical":
            return "white", f"critical, and its data is there: {known or 'none is needed'}"
        return "grey", "supporting: its data is there, and no detail is asked for"
    if part.physics and (part.data or role == "critical"):
        return "grey", f"{named} data is missing; completed by {part.physics}"
    if role == "critical":
        return "black", f"critical, but {named} data is missing and no physical law completes it"
    return "black", f"supporting, {named} data is missing"


def _missing(part: Component) -> tuple[Missing, ...]:
    if not part.interest:
        return ()
    had = {one.kind for one in part.data}
    unsure = [n for n, said in part.parameters.items() if said.source not in ("manufacturer", None)]
    out = []
    for kind in part.needs:
        if kind in had:
            continue
        seen = f" seen by {', '.join(part.sensors)}" if part.sensors and kind == "dynamic" else ""
        worn = f" of {', '.join(unsure)}" if unsure and kind == "dynamic" else ""
        out.append(Missing(kind, f"{kind} data{worn}", HOW[kind] + seen))
    without = [name for name, said in part.parameters.items() if said.value is None]
    tried = [name for name in without if part.parameters[name].source == "experiment"]
    for names, how in (
        (tried, "a first fit to recordings that move it"),
        (
            [name for name in without if name not in tried],
            "its maker's data, literature on like parts, or a first fit (source = 'experiment')",
        ),
    ):
        if names:
            out.append(Missing("initial value", f"initial values of {', '.join(names)}", how))
    return tuple(out)
