"""``evertwin setpoint``: which set-point gives the speed that is wanted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from evertwin.ahead.inverse import Inverse, SetPoint, inverse
from evertwin.app.console import show
from evertwin.app.opening import as_kept, recordings
from evertwin.errors import UsageError, naming
from evertwin.settings.quantity import number, written
from evertwin.signals.units import from_si, si_unit
from evertwin.twin import Twin

ROWS = 11
"""Of the map that is shown."""


def show_set_points(
    twin: Path, wanted: Sequence[str], names: tuple[str, str], data: Sequence[Path] | None,
    as_json: bool,
) -> None:  # fmt: skip
    """``evertwin setpoint``.

    Raises:
        UsageError: a wanted speed that is none, or speeds in units that do not fit each other.
    """
    if not wanted:
        raise UsageError("setpoint: expected --wanted SPEED, as in --wanted '10 cm/s'")
    for one in wanted:
        if not written(one)[1]:
            raise UsageError(
                f"--wanted: expected a speed with its unit, as in '10 cm/s', got {one!r}"
            )
    told = written(wanted[0])[1]
    with naming("--wanted"):
        unit = si_unit(told)
        speeds = [number(one, unit) for one in wanted]
    with Twin(as_kept(twin), reading=True) as opened:
        files = recordings(data)
        basis = opened.prospect(None, files).basis
        found = inverse(basis, speeds, unit, names, files)
    content = {
        "schema": "evertwin.setpoint/1", "input": found.channels[0], "output": found.channels[1],
        "unit": found.unit, "rate_unit": found.rate_unit, "version": found.version,
        "answers": [one.to_dict() for one in found.answers], "note": found.note,
        "map": {"set_point": found.set_points, "rate": found.rates},
    }  # fmt: skip
    recorded = basis.recorded.get(found.channels[0]) or found.unit
    show(content, _text(found, told, recorded), as_json)


def _text(found: Inverse, unit: str, recorded: str) -> str:
    """``unit``: of the wanted speeds; ``recorded``: that of the input, where it is another."""

    def said(value: float) -> str:
        return f"{float(from_si(value, unit)):.4g}"

    def to_set(value: float) -> str:
        return said(value) if same else f"{float(from_si(value, recorded)):.4g}"

    configured = " (as configured)" if found.version == 0 else ""
    same = found.unit == found.rate_unit
    told_in = unit if same else recorded.removeprefix("1")
    lines = [
        f"version {found.version}{configured}: {'' if found.direct else 'rate of '}"
        f"{found.channels[1]} [{unit}] for {found.channels[0]} [{told_in or '1'}] held, as far as "
        "the recordings have it"
    ]
    for one in found.answers:
        value = one.model_alone if one.set_point is None else one.set_point
        lines.append(_answer(one, found, unit, said, f"{to_set(value or 0.0)} {told_in}".rstrip()))
    places = [round(k * (len(found.set_points) - 1) / (ROWS - 1)) for k in range(ROWS)]
    lines.append("  map: " + ", ".join(
        f"{to_set(found.set_points[k])} → {said(found.rates[k])}" for k in places
    ))  # fmt: skip
    return "\n".join([*lines, *([f"  {found.note}"] if found.note else [])])


def _answer(
    one: SetPoint, found: Inverse, unit: str, said: Callable[[float], str], setting: str
) -> str:
    if one.set_point is None:
        lower, higher = one.nearest or (None, None)
        known = [f"{said(v)} {unit}" for v in (lower, higher) if v is not None]
        can = f"are {' and '.join(known)}" if len(known) > 1 else f"is {known[0]}"
        if not one.outside:
            return f"  {said(one.wanted)} {unit}: cannot be had; the nearest {can}"
        name = found.channels[0]
        alone = (
            f"; the model alone would set {name} = {setting}" if one.model_alone is not None else ""
        )
        return (
            f"  {said(one.wanted)} {unit}: not known, beyond what recorded {name} gives, of which "
            f"the nearest {can}{alone}"
        )
    low, high = one.gives95
    return (
        f"  {said(one.wanted)} {unit}: set {found.channels[0]} = {setting}; gives "
        f"{said(one.gives)} ({said(low)} … {said(high)}, 95 %)"
    )
