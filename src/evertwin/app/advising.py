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
    told = written(wanted[0])[1]
    if not told:
        raise UsageError(
            f"--wanted: expected a speed with its unit, as in '10 cm/s', got {wanted[0]!r}"
        )
    with naming("--wanted"):
        unit = si_unit(told)
        speeds = [number(one, unit) for one in wanted]
    with Twin(as_kept(twin), reading=True) as opened:
        files = recordings(data)
        found = inverse(opened.prospect(None, files).basis, speeds, unit, names, files)
    content = {
        "schema": "evertwin.setpoint/1", "input": found.channels[0], "output": found.channels[1],
        "unit": found.unit, "rate_unit": found.rate_unit, "version": found.version,
        "answers": [one.to_dict() for one in found.answers], "note": found.note,
        "map": {"set_point": found.set_points, "rate": found.rates},
    }  # fmt: skip
    show(content, _text(found, told), as_json)


def _text(found: Inverse, unit: str) -> str:
    def said(value: float) -> str:
        return f"{float(from_si(value, unit)):.4g}"

    configured = " (as configured)" if found.version == 0 else ""
    same = found.unit == found.rate_unit
    lines = [
        f"version {found.version}{configured}: rate of {found.channels[1]} [{unit}] for "
        f"{found.channels[0]} held, as far as the recordings have it"
    ]
    lines += [_answer(one, found, unit, said) for one in found.answers]
    places = [round(k * (len(found.set_points) - 1) / (ROWS - 1)) for k in range(ROWS)]
    shown = [(found.set_points[k], found.rates[k]) for k in places]
    lines.append("  map: " + ", ".join(
        f"{said(u) if same else f'{u:.4g}'} → {said(rate)}" for u, rate in shown
    ))  # fmt: skip
    return "\n".join([*lines, *([f"  {found.note}"] if found.note else [])])


def _answer(one: SetPoint, found: Inverse, unit: str, said: Callable[[float], str]) -> str:
    same = found.unit == found.rate_unit
    if one.set_point is None:
        lower, higher = one.nearest or (None, None)
        known = [f"{said(v)} {unit}" for v in (lower, higher) if v is not None]
        can = f"speeds are {' and '.join(known)}" if len(known) > 1 else f"is {known[0]}"
        return f"  {said(one.wanted)} {unit}: cannot be had; the nearest {can}"
    setting = f"{said(one.set_point)} {unit}" if same else f"{one.set_point:.4g} {found.unit}"
    low, high = one.gives95
    return (
        f"  {said(one.wanted)} {unit}: set {found.channels[0]} = {setting}; gives "
        f"{said(one.gives)} ({said(low)} … {said(high)}, 95 %)"
    )
