"""The arithmetic of `Randomized`, compiled: noise that depends on seed, row and channel alone.

A counter is mixed to 64 random bits (splitmix64: Steele, Lea, Flood, "Fast splittable pseudorandom
number generators", 2014) and two of them become a normal number (Box and Muller, 1958). There is
no generator to carry along, so rows may be cut anywhere.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, njit

from evertwin.models.kernel import ANEW
from evertwin.models.native import OBSERVE, STEP, call_observe, call_step, cfunc

# Header: length, inner step, inner observe, inner context, nu, nx inner, np, ny, seed; then the
# factors (np), the inputs' noise (nu) and the outputs' noise (ny) as bits of floats.
HEADER = 9


@njit(cache=True)
def mixed(counter: Any) -> Any:
    """64 well-mixed bits of a counter (splitmix64)."""
    z = np.uint64(counter) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True)
def normal(seed: Any, row: Any, channel: Any) -> Any:
    """A standard normal number of its own for every (seed, row, channel)."""
    key = mixed(mixed(mixed(seed) ^ np.uint64(row)) ^ np.uint64(channel))
    a = float((key >> np.uint64(11)) + np.uint64(1)) * 2.0**-53
    b = float(mixed(key) >> np.uint64(11)) * 2.0**-53
    return math.sqrt(-2.0 * math.log(a)) * math.cos(2.0 * math.pi * b)


@njit(cache=True)
def disturbed(values: Any, sigma: Any, seed: Any, row: Any, first: Any) -> None:
    """Adds noise to ``values`` in place; channels count from ``first``."""
    for k in range(values.shape[0]):
        if sigma[k] > 0.0:
            values[k] += sigma[k] * normal(seed, row, first + k)


@njit(cache=True, nogil=True)
def disturbed_run(
    values: Any, sigma: Any, seed: Any, begin: Any, first: Any, code: Any
) -> None:  # fmt: skip
    """`disturbed` over a whole roll-out, (n, channels), whose count of rows starts at ``begin``."""
    row = begin
    for i in range(values.shape[0]):
        if code[i] == ANEW:
            row = begin
        else:
            disturbed(values[i], sigma, seed, row, first)
            row += 1


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: Any, p: Any, x_next: Any, y: Any) -> Any:
    """One row: noise on the inputs, inner step with the drawn parameters, noise on the outputs."""
    plan = carray(context, (carray(context, (1,))[0],))
    nu, nx, n_p, ny, seed = plan[4], plan[5], plan[6], plan[7], plan[8]
    numbers = plan.view(np.float64)[HEADER:]
    now, ahead, out = carray(x, (nx + 1,)), carray(x_next, (nx + 1,)), carray(y, (ny,))
    row = int(now[nx])
    inputs = carray(u, (nu,)).copy()
    disturbed(inputs, numbers[n_p : n_p + nu], seed, row, 0)
    drawn = carray(p, (n_p,)) * numbers[:n_p]
    failed = call_step(
        plan[1], plan[3], now.ctypes.data, inputs.ctypes.data, dt, drawn.ctypes.data,
        ahead.ctypes.data, out.ctypes.data,
    )  # fmt: skip
    disturbed(out, numbers[n_p + nu : n_p + nu + ny], seed, row, nu)
    ahead[nx] = now[nx] + 1.0
    return failed


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> Any:
    """The inner model adopts; the count of rows goes on."""
    plan = carray(context, (HEADER,))
    call_observe(
        plan[2], plan[3], carray(x, (plan[5],)).ctypes.data, carray(y, (plan[7],)).ctypes.data
    )
    return 0
