"""Black boxes joined into an assembly: their channels, states and places, and their runs.

>>> from evertwin.machines.assembly.train import join
>>> from evertwin.machines.catalog import machine
>>> lines = [{"name": "table", "kind": "mass", "axis": 1},
...          {"name": "brake", "kind": "black_box", "axis": 1, "model": {"kind": "robot1d"},
...           "inputs": {"v": "speed"}}]
>>> [channel.name for channel in box_states(join(lines, machine))]
['brake.x']
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evertwin.machines.assembly import boxes, shared
from evertwin.machines.assembly.context import Signals, context_of
from evertwin.machines.assembly.shared import QUANTITIES
from evertwin.machines.assembly.train import Box, Train
from evertwin.models import Kernel, kernel_of
from evertwin.signals import Channel, Layout
from evertwin.types import Float64, Inputs, Int64, Intervals, ParameterVector, StateVector

_CHANNELS = {"position": "q", "speed": "qd", "acceleration": "qdd"}
_READS = {"position": shared.POSITION, "speed": shared.SPEED, "acceleration": shared.ACCELERATION}


def box_channels(train: Train) -> list[Channel]:
    """Channels that black boxes read from outside."""
    return [
        Channel(f"{box.name}.{channel.name}", channel.unit)
        for box in train.boxes
        for channel, source in zip(box.model.inputs, box.inputs, strict=True)
        if source == "input"
    ]


def box_states(train: Train) -> list[Channel]:
    """States of the black boxes."""
    return [
        Channel(f"{box.name}.{channel.name}", channel.unit)
        for box in train.boxes
        for channel in box.model.states
    ]


def box_start(train: Train, p: ParameterVector) -> list[float]:
    """States of the black boxes before the first row."""
    start: list[float] = []
    for box in train.boxes:
        first = _first_parameter(train, box)
        start += box.model.initial(p[first : first + len(box.model.parameters)]).tolist()
    return start


def _first_parameter(train: Train, box: Box) -> int:
    if not len(box.model.parameters):
        return 0
    return train.parameters.names.index(f"{box.name}.{box.model.parameters.names[0]}")


def reading_kernel(train: Train, signals: Signals, kind: Any, *, given: bool = False) -> Kernel:
    """The kernel of a reading: its own integers, then those of its black boxes.

    Args:
        kind: the module that holds the compiled step and adopt.
        given: are the boxes' efforts further columns of ``u``?
    """
    context, kept = context_of(train, signals)
    plan, inner = given_plan(train, signals) if given else box_plan(train, signals)
    return Kernel(kind.step, kind.adopt, np.concatenate([context, plan]), (*kept, *inner))


def box_plan(train: Train, signals: Signals) -> tuple[Int64[np.ndarray, " k"], tuple[Kernel, ...]]:
    """The black boxes' integers (`evertwin.machines.assembly.boxes`), and their kernels."""
    rows: list[int] = []
    first_state = len(signals.states) - len(box_states(train))
    sources: list[int] = []
    kernels = []
    for box in train.boxes:
        model = box.model
        kernel = kernel_of(model)
        kernels.append(kernel)
        rows += [
            int(kernel.step), int(kernel.context.ctypes.data), box.axis, first_state,
            _first_parameter(train, box), len(model.inputs), len(model.outputs), box.output,
            boxes.BOX * len(train.boxes) + len(sources),
        ]  # fmt: skip
        first_state += len(model.states)
        for name, source in zip(model.inputs.names, box.inputs, strict=True):
            sources.append(_source(box, name, source, signals.inputs))
    return np.array([*rows, *sources], dtype=np.int64), tuple(kernels)


def _source(box: Box, name: str, source: str, inputs: Sequence[str]) -> int:
    if source in _READS:
        return QUANTITIES * box.axis + _READS[source]
    return -1 - inputs.index(f"{box.name}.{name}")


def given_plan(
    train: Train, signals: Signals
) -> tuple[Int64[np.ndarray, " k"], tuple[Kernel, ...]]:
    """The integers of boxes whose efforts are columns of ``u`` behind the inputs."""
    rows: list[int] = []
    count, columns = len(train.boxes), len(signals.inputs)
    for k, box in enumerate(train.boxes):
        rows += [boxes.pass_on.address, 0, box.axis, 0, 0, 1, 1, 0]
        rows.append(boxes.BOX * count + k)
    return np.array([*rows, *(-1 - columns - k for k in range(count))], dtype=np.int64), ()


def run_over_rows(
    train: Train,
    inputs: Layout,
    run: tuple[StateVector, Inputs, Intervals, ParameterVector],
) -> tuple[Float64[np.ndarray, " k"], Float64[np.ndarray, "n boxes"]]:
    """Every box over all rows of an inverse reading: its states after them, and its efforts.

    Args:
        run: states, inputs, intervals and parameters of the assembly.
    """
    x, u, dt, p = run
    at = len(x) - len(box_states(train))
    ends, efforts = [], []
    for box in train.boxes:
        model = box.model
        columns = [
            inputs.index(_column(box, name, source))
            for name, source in zip(model.inputs.names, box.inputs, strict=True)
        ]
        first, size = _first_parameter(train, box), len(model.parameters)
        own = p[first : first + size].copy()
        state = x[at : at + len(model.states)].copy()
        end, y = model.simulate(state, np.ascontiguousarray(u[:, columns]), dt, own)
        at += len(model.states)
        ends.append(end)
        efforts.append(y[:, box.output])
    return np.concatenate(ends), np.column_stack(efforts)


def _column(box: Box, name: str, source: str) -> str:
    """The input of the assembly that a box's input reads."""
    if source == "input":
        return f"{box.name}.{name}"
    return f"{_CHANNELS[source]}{box.axis + 1}"
