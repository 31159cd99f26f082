"""An assembly by the options of a twin file: components in, a Model out.

>>> lines = [{"name": "table", "kind": "mass", "axis": 1, "mass": 10.0}]
>>> assembly(lines).outputs.names, assembly(lines, "forward").outputs.names
(('tau1',), ('q1', 'qd1'))
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from evertwin.errors import UsageError
from evertwin.machines.assembly.forward import Forward, forward
from evertwin.machines.assembly.inverse import Inverse, inverse
from evertwin.machines.assembly.train import join
from evertwin.machines.catalog import machine
from evertwin.settings.quantity import in_unit


def assembly(
    components: Any,
    reading: str = "inverse",
    measure: str | Sequence[str] = "effort",
    sensors: Sequence[str] = (),
    step: float | str | None = None,
) -> Inverse | Forward:
    """Components, joined, in one of their two readings.

    Args:
        components: a list with one line each (`evertwin.machines.assembly.parts`).
        reading: ``inverse`` (motion in, effort out) or ``forward`` (commands in, motion out).
        measure: of the inverse reading: effort, torque, current or voltage, of all axes or of each.
        sensors: quantities inside components that are outputs too.
        step: of the forward reading: largest part of a row [s], or text such as "0.5 ms".

    Raises:
        UsageError: the components cannot be joined, or have no such reading.
    """
    if not isinstance(components, list | tuple):
        raise UsageError(f"components: expected a list of lines, got {components!r}")
    train = join(components, machine)
    if reading == "inverse":
        if step is not None:
            raise UsageError("assembly: step belongs to the forward reading")
        return inverse(train, measure, sensors)
    if reading == "forward":
        if measure != "effort":
            raise UsageError("assembly: measure belongs to the inverse reading; name sensors")
        return forward(train, sensors, None if step is None else in_unit("step", step, "s"))
    raise UsageError(f"assembly: expected reading = 'inverse' or 'forward', got {reading!r}")
