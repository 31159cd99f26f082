"""Black boxes inside an assembly's kernels: another model's step, called by its address.

A box reads quantities of its axis from the bus (or columns of the input) and gives one effort
against the motion. Behind the assembly's own integers the context holds `BOX` integers a box, then
what each of its inputs reads: a place on the bus, or −1 − column of ``u``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.calls import call
from evertwin.compiled.functions import STEP, cfunc, njit
from evertwin.compiled.memory import carray
from evertwin.machines.assembly.context import END, NB, NF, N
from evertwin.machines.assembly.shared import QUANTITIES, RUBS

STEP_AT, CONTEXT_AT, BOX_AXIS, STATES, PARAMETERS, INPUTS, OUTPUTS, EFFORT, SOURCES = range(9)
BOX = 9
"""Addresses of step and context, axis, first state, first parameter, numbers of inputs and
outputs, the output that is the effort, where its sources begin."""


@cfunc(STEP)
def pass_on(context: Any, x: Any, u: Any, dt: float, p: Any, ahead: Any, y: Any) -> int:
    """Stands for a box whose effort has been simulated already: its output is its input."""
    y[0] = u[0]  # pragma: compiled
    return 0


@njit(cache=True)
def address(pointer: Any) -> int:
    """Address of what a kernel was given."""
    return int(carray(pointer, (1,)).ctypes.data)


@njit(cache=True)
def box_axis(context: Any, k: int) -> int:
    """Axis that box ``k`` acts on."""
    return int(context[context[END] + BOX * k + BOX_AXIS])


@njit(cache=True)
def run_boxes(context: Any, x: int, u: Any, dt: float, p: int, ahead: int, bus: Any) -> int:
    """One step of every box; ``x``, ``p`` and ``ahead`` by address. 0: fine."""
    first, n, failed = context[END], context[N], 0
    for k in range(context[NB]):
        at = first + BOX * k
        values = np.empty(context[at + INPUTS])
        for i in range(context[at + INPUTS]):
            source = context[first + context[at + SOURCES] + i]
            values[i] = bus[source] if source >= 0 else u[-1 - source]
        out = np.zeros(context[at + OUTPUTS])
        states = 8 * context[at + STATES]
        failed |= call(
            context[at + STEP_AT], context[at + CONTEXT_AT], x + states, values.ctypes.data, dt,
            p + 8 * context[at + PARAMETERS], ahead + states, out.ctypes.data,
        )  # fmt: skip
        bus[QUANTITIES * n + RUBS * context[NF] + k] = out[context[at + EFFORT]]
    return failed
