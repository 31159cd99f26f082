"""Compiled: one row of an FMU, called by address in the process that holds it.

A row sets the inputs, advances by ``dt``, and reads outputs and states. An FMU remembers more than
one number, so a row first makes sure that it stands where ``x`` says: the page keeps the last
state, and where another one comes in (a new start, an adopted measurement, another parameter) the
state is set again. See `evertwin.models.fmu.slots` for the page.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, cfunc, njit
from evertwin.compiled.memory import carray, copied
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.calls import call

MOST = 100_000
"""Steps inside one row."""
STAGES = np.array([1, 2, 4])
REACH = np.array([[0.0] * 4, [0.0, 1.0, 0.0, 0.0], [0.0, 0.5, 0.5, 1.0]])
SHARE = np.array([[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [1 / 6, 1 / 3, 1 / 3, 1 / 6]])
"""Euler, Heun and Runge-Kutta: stages, where each is asked, and its share of the step."""


@njit(cache=True)
def _exchange(page: Any, g: int, function: int) -> int:
    """Calls the FMU's set or get function for a group; values are in its buffer."""
    q, base = at.GROUPS + at.FIELDS * g, page.ctypes.data
    n, count, refs, data = page[q], page[q + 1], base + 8 * page[q + 2], base + 8 * page[q + 5]
    if page[at.THREE]:
        return int(call(page[function], (page[at.COMPONENT], refs, count, data, n)))
    return int(call(page[function], (page[at.COMPONENT], refs, count, data)))


@njit(cache=True)
def set_group(page: Any, numbers: Any, g: int, values: Any) -> Any:
    """Sets the values of a group, given in SI."""
    q = at.GROUPS + at.FIELDS * g
    n = page[q]
    if n == 0:
        return 0
    factor, offset, buffer = page[q + 3], page[q + 4], page[q + 5]
    scaled = (values - numbers[offset : offset + n]) / numbers[factor : factor + n]
    copied(numbers[buffer : buffer + n], scaled)
    return _exchange(page, g, at.SET)


@njit(cache=True)
def get_group(page: Any, numbers: Any, g: int, values: Any) -> Any:
    """Reads the values of a group into ``values``, in SI."""
    q = at.GROUPS + at.FIELDS * g
    n = page[q]
    if n == 0:
        return 0
    factor, offset, buffer = page[q + 3], page[q + 4], page[q + 5]
    status = _exchange(page, g, at.GET)
    for k in range(n):
        values[k] = numbers[buffer + k] * numbers[factor + k] + numbers[offset + k]
    return status


@njit(cache=True)
def differs(numbers: Any, offset: int, values: Any) -> bool:
    """Are the numbers at ``offset`` other than ``values``?"""
    return bool((numbers[offset : offset + values.shape[0]] != values).any())


@njit(cache=True)
def known(values: Any) -> bool:
    """True if every value is finite."""
    for k in range(values.shape[0]):  # noqa: SIM110 - generators do not compile
        if not math.isfinite(values[k]):
            return False
    return True


@njit(cache=True)
def refused(page: Any, n: int) -> bool:
    """Must this step fail, because the FMU broke down in it before?"""
    skipped = (page[at.SKIP : at.SKIP + at.SKIPS] == n).any()
    return bool(skipped or 0 <= page[at.FROM] <= n)


@njit(cache=True)
def parts_of(dt: float, longest: float) -> Any:
    """Into how many equal steps a row is cut; −1: too many."""
    if longest <= 0.0 or dt <= longest:
        return 1
    parts = math.ceil(dt / longest - 1e-9)
    return int(parts) if parts <= MOST else -1


@njit(cache=True)
def advance_slave(page: Any, numbers: Any, dt: float) -> Any:
    """Co-simulation: the FMU solves itself."""
    q = page[at.REALS]
    static = page[at.MEMORY] == at.STATIC
    span = dt if dt > 0.0 or not static else numbers[q + at.HOLD]
    if span <= 0.0:
        return 0
    parts = parts_of(span, numbers[q + at.STEP])
    if parts < 0:
        return at.TOO_MANY
    h, begun, w = span / parts, numbers[q + at.TIME], page[at.WORK]
    last = 0 if page[at.MEMORY] == at.SAVED else 1
    flags = page.ctypes.data + 8 * w
    for k in range(parts):
        t = begun + k * h
        if page[at.THREE]:
            page[w] = page[w + 1] = page[w + 2] = 0
            told = flags, flags + 8, flags + 16, flags + 24
            status = call(page[at.DOSTEP], (page[at.COMPONENT], t, h, last, *told))
            if status <= 1 and (page[w + 1] & 255 or page[w + 2] & 255):
                return at.ENDED
        else:
            status = call(page[at.DOSTEP], (page[at.COMPONENT], t, h, last))
        if status > 1:
            return int(status)
    numbers[q + at.TIME] = begun + span
    return 0


@njit(cache=True)
def derivatives(page: Any, numbers: Any, t: float, x: int, dx: int) -> Any:
    """Derivatives into the work at ``dx`` of the states (in the FMU's units) at ``x``."""
    base, c, nx = page.ctypes.data, page[at.COMPONENT], page[at.GROUPS + at.FIELDS * at.X]
    status = max(call(page[at.SETTIME], (c, t)), call(page[at.SETX], (c, base + 8 * x, nx)))
    if status <= 1:
        status = call(page[at.GETDX], (c, base + 8 * dx, nx))
    return int(status)


@njit(cache=True)
def solve(page: Any, numbers: Any, t: float, h: float) -> Any:
    """One explicit step of the states at WORK, in place."""
    nx, x, solver = page[at.GROUPS + at.FIELDS * at.X], page[at.WORK], page[at.SOLVER]
    slope, place, mean = x + nx, x + 2 * nx, x + 3 * nx
    now, k = numbers[x : x + nx], numbers[slope : slope + nx]
    total = numbers[mean : mean + nx]
    k[:] = total[:] = 0.0
    for stage in range(STAGES[solver]):
        reach = h * REACH[solver, stage]
        copied(numbers[place : place + nx], now + reach * k)
        status = derivatives(page, numbers, t + reach, place, slope)
        if status > 1:
            return status
        total += SHARE[solver, stage] * k
    now += h * total
    return 0


@njit(cache=True)
def stand(page: Any, numbers: Any, t: float) -> Any:
    """Puts time and the states at WORK into the FMU."""
    c, nx = page[at.COMPONENT], page[at.GROUPS + at.FIELDS * at.X]
    status = call(page[at.SETTIME], (c, t))
    if nx > 0 and status <= 1:
        status = max(status, call(page[at.SETX], (c, page.ctypes.data + 8 * page[at.WORK], nx)))
    return int(status)


@njit(cache=True)
def settle(page: Any, numbers: Any, t: float) -> Any:
    """The end of a step: the FMU is told, and its events happen, as exact as the step is."""
    c, base, w, nz = page[at.COMPONENT], page.ctypes.data, page[at.WORK], page[at.NZ]
    status = stand(page, numbers, t)
    event = False
    flags = w + 6 * max(page[at.NX], 1) + 2 * nz
    if status <= 1 and page[at.COMPLETED]:
        page[flags] = page[flags + 1] = 0
        status = call(page[at.COMPLETED], (c, 1, base + 8 * flags, base + 8 * flags + 8))
        event = (page[flags] & 0xFFFFFFFF) != 0
        if page[flags + 1] & 0xFFFFFFFF:
            return at.ENDED
    if status <= 1 and nz > 0:
        before, after = flags - 2 * nz, flags - nz
        status = call(page[at.GETZ], (c, base + 8 * after, nz))
        for k in range(nz):
            event = event or (numbers[before + k] > 0.0) != (numbers[after + k] > 0.0)
    if status <= 1 and event:
        status = call(page[at.EVENTS], (base, base + 8 * w, base + 8 * w))
    return int(status)


@njit(cache=True)
def advance_model(page: Any, numbers: Any, now: Any, dt: float) -> Any:
    """Model exchange: solved here, with the input held."""
    q, w, nz = page[at.REALS], page[at.WORK], page[at.NZ]
    g = at.GROUPS + at.FIELDS * at.X
    nx, factor, offset = page[g], page[g + 3], page[g + 4]
    for k in range(nx):
        numbers[w + k] = (now[k] - numbers[offset + k]) / numbers[factor + k]
    parts = parts_of(dt, numbers[q + at.STEP])
    if parts < 0:
        return at.TOO_MANY
    begun = numbers[q + at.TIME]
    if dt <= 0.0:
        return stand(page, numbers, begun)
    h = dt / parts
    for k in range(parts):
        t = begun + k * h
        if nz > 0:
            status = stand(page, numbers, t)
            before = w + 6 * max(page[at.NX], 1)
            if status <= 1:
                status = call(
                    page[at.GETZ], (page[at.COMPONENT], page.ctypes.data + 8 * before, nz)
                )
            if status > 1:
                return int(status)
        status = solve(page, numbers, t, h) if nx > 0 else 0
        if status <= 1:
            status = settle(page, numbers, begun + (k + 1) * h)
        if status > 1:
            return int(status)
    numbers[q + at.TIME] = begun + dt
    return 0


@njit(cache=True)
def pack(page: Any, numbers: Any, ahead: Any) -> Any:
    """The FMU's saved state as whole numbers of 48 bits in ``ahead``, behind its length."""
    c, base, w, b = page[at.COMPONENT], page.ctypes.data, page[at.WORK], page[at.BYTES]
    page[w] = page[w + 1] = 0
    status = call(page[at.GETSTATE], (c, base + 8 * w))
    if status <= 1:
        status = call(page[at.SIZESTATE], (c, page[w], base + 8 * w + 8))
    size, room = page[w + 1], 6 * (page[at.CAPACITY] - 1)
    if status <= 1 and not 0 <= size <= room:
        status = at.TOO_LARGE
    if status <= 1:
        raw = np.zeros(room + 8, dtype=np.uint8)
        status = call(page[at.WRITESTATE], (c, page[w], raw.ctypes.data, size))
        ahead[b] = size
        for k in range(page[at.CAPACITY] - 1):
            word = 0
            for j in range(5, -1, -1):
                word = word * 256 + raw[6 * k + j]
            ahead[b + 1 + k] = word
    freed = call(page[at.FREESTATE], (c, base + 8 * w))
    return int(max(status, freed))


@njit(cache=True)
def read(page: Any, numbers: Any, now: Any, dt: float, ahead: Any, out: Any) -> Any:
    """Outputs and states at the end of a row."""
    status = get_group(page, numbers, at.Y, out)
    if status > 1:
        return status
    memory, w = page[at.MEMORY], page[at.WORK]
    g = at.GROUPS + at.FIELDS * at.X
    if memory == at.CONTINUOUS:
        factor, offset = page[g + 3], page[g + 4]
        for k in range(page[g]):
            ahead[k] = numbers[w + k] * numbers[factor + k] + numbers[offset + k]
    elif memory != at.STATIC:
        status = get_group(page, numbers, at.X, ahead)
    if page[at.CLOCK] >= 0:
        ahead[page[at.CLOCK]] = now[page[at.CLOCK]] + dt
    if memory == at.SAVED and status <= 1:
        status = pack(page, numbers, ahead)
    return status


@njit(cache=True)
def advance(page: Any, numbers: Any, now: Any, u: Any, dt: float, p: Any, ahead: Any,
            out: Any) -> Any:  # fmt: skip
    """One row of a healthy FMU: its status."""
    base, q = page.ctypes.data, page[at.REALS]
    fresh = page[at.HELD] == 0 or differs(numbers, page[at.LAST_P], p)
    if fresh or differs(numbers, page[at.LAST_X], now):
        status = call(page[at.RESTORE], (base, now.ctypes.data, p.ctypes.data))
        if status > 1:
            return int(status)
    if page[at.CLOCK] >= 0:
        numbers[q + at.TIME] = now[page[at.CLOCK]]
    status = set_group(page, numbers, at.U, u)
    if status > 1:
        return status
    if page[at.MEMORY] == at.CONTINUOUS:
        status = advance_model(page, numbers, now, dt)
    else:
        status = advance_slave(page, numbers, dt)
    if status > 1:
        return status
    return read(page, numbers, now, dt, ahead, out)


@cfunc(STEP)
def step(context: Any, x: Any, u: Any, dt: Any, p: Any, x_next: Any, y: Any) -> Any:
    """One row. A row that fails keeps the state, and the FMU starts from it again."""
    page = carray(context, (carray(context, (1,))[0],))
    numbers = page.view(np.float64)
    now, ahead = carray(x, (page[at.NX],)), carray(x_next, (page[at.NX],))
    inputs, out = carray(u, (page[at.NU],)), carray(y, (page[at.NY],))
    values = carray(p, (page[at.NP],))
    n = page[at.COUNT]
    page[at.COUNT] = n + 1
    copied(ahead, now)
    if refused(page, n):
        status = at.SKIPPED
    elif not (known(inputs) and known(now) and known(values) and 0.0 <= dt < math.inf):
        status = at.NOT_FINITE_IN
    else:
        page[at.INSIDE] = 1
        status = advance(page, numbers, now, inputs, dt, values, ahead, out)
        if status <= 1 and not (known(ahead) and known(out)):
            status = at.NOT_FINITE
        if status == at.FATAL:
            call(page[at.LEAVE], (at.EXIT_FATAL,))
        page[at.INSIDE] = 0
    if status > 1:
        copied(ahead, now)
        out[:] = np.nan
        page[at.HELD] = 0
        if status != at.NOT_FINITE_IN:
            page[at.FIRST] = n if page[at.BAD] == 0 else page[at.FIRST]
            page[at.BAD] += 1
            page[at.STATUS] = status
        return 1
    copied(numbers[page[at.LAST_X] :], ahead)
    copied(numbers[page[at.LAST_P] :], values)
    page[at.HELD] = 1
    return 0


@cfunc(OBSERVE)
def adopt(context: Any, x: Any, y: Any) -> Any:
    """Outputs that are states' own values are adopted into them."""
    page = carray(context, (carray(context, (1,))[0],))
    now, measured = carray(x, (page[at.NX],)), carray(y, (page[at.NY],))
    for k in range(page[at.PAIRS]):
        i, j = page[page[at.ADOPTS] + 2 * k], page[page[at.ADOPTS] + 2 * k + 1]
        if not math.isnan(measured[i]):
            now[j] = measured[i]
    return 0
