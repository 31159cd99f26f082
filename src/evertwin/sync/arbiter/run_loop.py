"""Compiled: runs of values that do not follow the motion that the model predicts.

Two kinds are kept beside each other. *Equal*: the same value again, or one of two in turn, as a
frozen sensor gives it. *Near*: values that stay closer together than the sensor's own noise lets
them, as a frozen sensor with a dither gives them. Single samples outside the gate do not end a run.

A machine that stands against its model keeps the sensor's noise; one without noise is told from a
frozen sensor by where it goes on from, and from then on by how fast it was predicted to move.

See `evertwin.sync.arbiter.plausible_loop` for the tuples of arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.compiled.functions import njit
from evertwin.sync import places as at
from evertwin.sync.horizon.horizon_loop import wrapped
from evertwin.sync.options import COLD, HOT
from evertwin.sync.places import Cause
from evertwin.sync.workspace import Case

FROZEN, FACTOR = int(Cause.FROZEN), int(Cause.FACTOR)
EQUAL, NEAR = 0, 1
SURE = 12
"""Near values in a row: of Gaussian noise, four in ten lie as near to the first."""
MEMORY = 2000
"""Samples that the noise of the sensor is estimated from."""
LINED = 6.0
"""Variances of a sample's noise in its way off the line through the two before."""
USUAL = 9.0
"""Times the noise's variance that two successive innovations say of it at most: where the form is
wrong, as where friction turns round, they would say much more."""
ALIKE = 1.5
"""Times the smallest change that another is larger by, if it is about as small."""
FORGET, MOST = 1.0 / 1024, 2.0
"""Part of the way of a sound run that each later one forgets; times the limit that one tells at
most."""
PART = 0.5
"""Part of the motion that a sound sensor shows, from which on an answer is due."""
GUESS = 4.0
"""Smallest changes that a sensor may stay for where it was never seen to."""
LEANS = 1.0
"""So many times as far as a model moves beside its machine anyway is no motion by itself."""
LATE, SLOW = 3.0, 0.05
"""Samples that one which may stay may be late by, where it was never seen to; and share of its
usual speed that is no motion by itself."""
MOVED, MANY = 0.25, 200
"""Share of an output's usual size that it has to be predicted to move, and samples that tell it."""


@njit(**HOT)
def near_square(values: Any, numbers: Any, g: int, j: int) -> float:
    """How near to each other the sensor's noise hardly lets values lie, squared: half a deviation.

    Successive changes share one sample's noise: −E[ν·ν'] is its variance, whatever else moves. Of
    the estimate the lower bound counts (2σ). Of what no state adopts noise of inputs is in it, but
    not in how samples lie off a straight line. What is frozen may scatter four times as much.
    """
    n = min(max(numbers[g, at.SAMPLES], 1), MEMORY)
    variance = values[j, at.NOISE] - 2.0 * values[j, at.BASE] / np.sqrt(n)
    variance = min(variance, values[j, at.LINE] / LINED)
    found = numbers[g, at.CAUSE] == FROZEN and numbers[g, at.HELD_BY] == NEAR
    return float((4.0 if found else 0.25) * max(variance, 0.0))


@njit(**HOT)
def learn_noise(values: Any, numbers: Any, room: Any, g: int, size: int) -> None:
    """One more trusted innovation, for the noise of the sensor; not of one that may be frozen, nor
    while nothing says which is an outlier."""
    share = 1.0 / min(max(numbers[g, at.SAMPLES], 1), MEMORY)
    alone = numbers[g, at.RUN + NEAR] < 2
    for k in range(size):
        j = room[k]
        nu, before = values[j, at.NU], values[j, at.NU_BEFORE]
        if alone and before == before and values[j, at.BASE] < np.inf:
            most = USUAL * max(values[j, at.NOISE], values[j, at.BASE])
            spoken = min(max(-nu * before, -most), most)
            values[j, at.NOISE] += (spoken - values[j, at.NOISE]) * share
        values[j, at.NU_BEFORE] = nu


@njit(**HOT)
def needed(rules: Any, g: int, kind: int) -> float:
    """Values in a row that make a sensor frozen, where motion is predicted."""
    return float(rules[g, at.FROZEN] if kind == EQUAL else SURE)


@njit(**HOT)
def place_in_run(case: Case, g: int, size: int, kind: int) -> int:
    """1: the sample has the value of the run; 2: the other one of two in turn; 0: neither."""
    (limits, rules, _), (values, numbers, _) = case.settings, case.memory
    room, y = case.sample[0], case.sample[1]
    if numbers[g, at.RUN + kind] == 0:
        return 0
    if kind == NEAR:
        for k in range(size):
            j = room[k]
            off = wrapped(y[j] - values[j, at.HELD + NEAR], limits[j, at.ANGLE] > 0)
            # the bound first: most samples are beyond what any noise could be
            square = off * off
            if square > 4.0 * values[j, at.NOISE] or square > near_square(values, numbers, g, j):
                return 0
        return 1
    place = 1
    for k in range(size):
        j = room[k]
        if y[j] != values[j, at.HELD]:
            place = 2
    for k in range(size if place == 2 else 0):
        j = room[k]
        way = wrapped(values[j, at.OTHER] - values[j, at.HELD], limits[j, at.ANGLE] > 0)
        # one that went farther than it may stay for has answered
        if y[j] != values[j, at.OTHER] or abs(way) > enough(rules, values, numbers, g, j, kind):
            return 0
    return place


@njit(**COLD)
def standstill(case: Case, g: int, size: int, kind: int) -> bool:
    """A run ends: did the machine stand still, against the model's prediction?

    Then the new value continues from the old one; after a sensor's fault it lies at the prediction.
    """
    (limits, rules, _), values = case.settings, case.memory[0]
    room, y = case.sample[0], case.sample[1]
    for k in range(size):
        j = room[k]
        gone = values[j, at.GONE + kind]
        if abs(gone) > 2 * rules[g, at.GATE] * np.sqrt(values[j, at.BASE]):
            angle = limits[j, at.ANGLE] > 0
            moved = abs(wrapped(y[j] - values[j, at.HELD + kind], angle))
            expected = values[j, at.ORIGIN + kind] + values[j, at.BEFORE + kind] + gone
            return bool(moved < 0.5 * abs(wrapped(y[j] - expected, angle)))
    return False


@njit(**HOT)
def stays(values: Any, j: int) -> bool:
    """May an output stay though its machine moves? One whose noise is over half a step may not."""
    return bool(not 4.0 * values[j, at.NOISE] > values[j, at.STEP] * values[j, at.STEP])


@njit(**HOT)
def goes(limits: Any, values: Any, j: int, moved: float, instead: float) -> None:
    """The output is predicted to move, in place of what was said before: the way of its runs.

    A state that follows a sensor which stays, within its resolution or because its machine stands,
    is predicted to leave at each row anew. As fast as machines were that stood, and as a small
    share of the usual speed, that is no motion which a frozen sensor would miss.
    """
    for kind in range(2):
        creep = max(values[j, at.CREEP + kind], SLOW * values[j, at.USUAL] * stays(values, j))
        creep *= limits[j, at.ADOPTS] > 0
        values[j, at.GONE + kind] += moved - instead
        values[j, at.BEYOND + kind] += moved - min(max(moved, -creep), creep)
        values[j, at.BEYOND + kind] -= instead - min(max(instead, -creep), creep)


@njit(**HOT)
def learn_step(limits: Any, values: Any, sample: Any, size: int) -> None:
    """The smallest change of an output; what rounding makes is none."""
    room, y = sample[0], sample[1]
    for k in range(size):
        j = room[k]
        change = abs(wrapped(y[j] - values[j, at.LAST], limits[j, at.ANGLE] > 0))
        values[j, at.ANEW] = change > 1e-9 * abs(y[j])
        if not values[j, at.ANEW] > 0:
            continue
        values[j, at.VARIED] += 1.0
        step = values[j, at.STEP] if values[j, at.STEP] > 0.0 else np.inf
        if change * ALIKE < step:
            values[j, at.CHANGED] = 0.0
        values[j, at.CHANGED] += change < step * ALIKE
        values[j, at.STEP] = min(change, step)


@njit(**HOT)
def step_of(values: Any, j: int) -> float:
    """Of a coarse sensor; 0 where it is none, or not known."""
    return float(values[j, at.STEP] if values[j, at.CHANGED] >= at.STEPS else 0.0)


@njit(**HOT)
def patience(values: Any, j: int, kind: int) -> float:
    """Samples by which an answer of a sound sensor may be late."""
    return float(1.0 + max(values[j, at.LATE + kind], LATE if stays(values, j) else 0.0))


@njit(**HOT)
def learn_sound(case: Case, g: int, size: int, kind: int) -> None:
    """A run ends, so its sensor responds: how far, and how long ahead of it, the prediction goes.

    Once may have been a fault, which counts as little beyond what was usual; of the way the second
    counts. A late answer tells of no way. Nor does a machine that stood for longer than any answer
    was late: it tells how fast one is predicted to move that stands.
    """
    rules, (values, numbers, _) = case.settings[1], case.memory
    room, stood = case.sample[0], numbers[g, at.STOOD + kind] > 0
    for k in range(size if numbers[g, at.RUN + kind] > 1 else 0):
        j = room[k]
        went, overdue = values[j, at.WENT + kind], values[j, at.OVERDUE + kind]
        soon = patience(values, j, kind)
        values[j, at.RUNS + kind] += 1.0
        for place in (at.FARTHEST, at.SOUND, at.LATE, at.CREEP):
            values[j, place + kind] *= 1.0 - FORGET
        if stood and overdue > MOST * soon:
            rate = abs(values[j, at.GONE + kind]) / numbers[g, at.RUN + kind]
            values[j, at.CREEP + kind] = max(values[j, at.CREEP + kind], ALIKE * rate)
            continue
        late = min(overdue, MOST * (1.0 + values[j, at.LATE + kind]))
        values[j, at.LATE + kind] = max(values[j, at.LATE + kind], late)
        if 0.0 < overdue <= soon:
            continue
        went = min(went, MOST * enough(rules, values, numbers, g, j, kind))
        second = min(went, values[j, at.FARTHEST + kind])
        values[j, at.SOUND + kind] = max(values[j, at.SOUND + kind], second)
        values[j, at.FARTHEST + kind] = max(values[j, at.FARTHEST + kind], went)


@njit(**HOT)
def go_on(case: Case, g: int, size: int, kind: int) -> None:
    """One more sample of a run: how far the prediction went, and is an answer due?

    What no state adopts has no lag in its model: half the way counts, and how late it answers.
    """
    rules, (values, numbers, _), room = case.settings[1], case.memory, case.sample[0]
    for k in range(size):
        j = room[k]
        if values[j, at.RESTS] > 0:
            continue
        way = abs(values[j, at.BEYOND + kind])
        if numbers[g, at.AWAY + kind] == 0:
            values[j, at.WENT + kind] = max(values[j, at.WENT + kind], way)
        part = PART if values[j, at.EXPECTED] > 0 else 1.0
        values[j, at.OVERDUE + kind] += way >= part * enough(rules, values, numbers, g, j, kind)


@njit(**HOT)
def follow(case: Case, g: int, size: int, now: Any, outside: bool) -> None:
    """Keeps the runs: the sample continues, leaves for a moment, or ends each.

    The same value twice away from a run is the next run, unless the sensor is known to be frozen.
    """
    (limits, rules, _), (values, numbers, _) = case.settings, case.memory
    room, y, again = case.sample[0], case.sample[1], True
    for k in range(size):
        again = again and y[room[k]] == values[room[k], at.LAST]
    if numbers[g, at.SAMPLES] > 0:
        learn_step(limits, values, case.sample, size)
    for kind in range(2):
        place = place_in_run(case, g, size, kind)
        if place > 0:
            numbers[g, at.RUN + kind] += 1
            numbers[g, at.AWAY + kind] = 0
            numbers[g, at.TURNS] += place - 1
            go_on(case, g, size, kind)
            continue
        if numbers[g, at.AWAY + kind] == 0:
            long = 0 < needed(rules, g, kind) <= numbers[g, at.RUN + kind]
            stood = long and standstill(case, g, size, kind)
            numbers[g, at.STOOD + kind] = stood
        lasting = numbers[g, at.CAUSE] == FROZEN or (numbers[g, at.RUN + kind] > 1 and not again)
        if outside and lasting and numbers[g, at.AWAY + kind] + 1 < rules[g, at.FROZEN]:
            numbers[g, at.AWAY + kind] += 1
            go_on(case, g, size, kind)
            continue
        learn_sound(case, g, size, kind)
        ended = numbers[g, at.RUN + kind]
        numbers[g, at.FREE] *= numbers[g, at.FREE] != kind + 1
        numbers[g, at.RUN + kind], numbers[g, at.AWAY + kind] = 1, 0
        numbers[g, at.RUN_ROW + kind], numbers[g, at.RUN_AT + kind] = now[0], now[1]
        if kind == EQUAL:
            numbers[g, at.TURNS] = 0
            numbers[g, at.QUIET] |= ended >= rules[g, at.FROZEN] and numbers[g, at.CAUSE] != FROZEN
        for k in range(size):
            j = room[k]
            if kind == EQUAL:
                values[j, at.OTHER] = values[j, at.HELD]
            values[j, at.HELD + kind] = y[j]
            for way in (at.GONE, at.BEYOND, at.WENT, at.OVERDUE):
                values[j, way + kind] = 0.0


@njit(**HOT)
def may_revive(rules: Any, numbers: Any, g: int) -> bool:
    """May a sample be believed that leaves the prediction, though the sensor was frozen until now?

    One that is where it is predicted, always; another one only after some in a row.
    """
    away = numbers[g, at.AWAY + numbers[g, at.HELD_BY]]
    return bool(numbers[g, at.CAUSE] != FROZEN or away + 1 >= rules[g, at.FROZEN])


@njit(**HOT)
def predicts_too_much(values: Any, room: Any, size: int) -> bool:
    """Is an output that no state adopts expected at more than `FAR` times its size?"""
    for k in range(size):
        if values[room[k], at.EXPECTED] > at.FAR * values[room[k], at.ALIKE]:
            return True
    return False


@njit(**HOT)
def enough(rules: Any, values: Any, numbers: Any, g: int, j: int, kind: int) -> float:
    """Predicted motion that a sound sensor shows.

    An error of the form widens the gate of an output that no state adopts, and a wide gate would
    hide a frozen sensor. Where equal values never were sound, a share of its usual size does. A
    coarse sensor stays while its machine moves by less than a step: twice as far as the prediction
    went while it did. A model that moves beside its machine goes on so
    where that turns round.
    """
    gate = rules[g, at.GATE] * np.sqrt(values[j, at.BASE])
    step = values[j, at.STEP]
    guess = GUESS * step / np.sqrt(1.0 + 0.5 * values[j, at.RUNS + kind])
    gate = max(gate, ALIKE * max(step, values[j, at.SOUND + kind]), guess)
    if not step > 0.0:
        far = max(rules[g, at.GATE] * gate, ALIKE * abs(values[j, at.HELD + kind]))
        gate = far if numbers[g, at.RUN + kind] >= MANY else np.inf
    if not values[j, at.EXPECTED] > 0:
        samples = min(numbers[g, at.RUN + kind], 2.0 * needed(rules, g, kind))
        gate = max(gate, LEANS * samples * values[j, at.LEANT + kind])
    known = kind == EQUAL and numbers[g, at.QUIET] == 0 and numbers[g, at.SAMPLES] >= MANY
    if known and values[j, at.EXPECTED] > 0:
        return float(min(gate, MOVED * np.sqrt(values[j, at.EXPECTED])))
    return float(gate)


@njit(**HOT)
def is_frozen(rules: Any, memory: Any, room: Any, g: int, size: int) -> bool:
    """Is the sample one of a run while the model predicts motion beyond the noise?

    One sample with it is none, nor are as many as a sound machine let pass before it answered.
    Of two values in turn, motion beyond twice as much: a machine may creep from one to the other.
    Equal values that leave the prediction need no motion, where the sensor's noise never let any be
    equal. Equal values, and those of an output that no state adopts, stay frozen while their run
    lasts, though the prediction passes them again.
    """
    values, numbers, _ = memory
    if not rules[g, at.FROZEN] > 0:
        return False
    if numbers[g, at.CAUSE] == FROZEN:
        by = numbers[g, at.HELD_BY]
        lasts = by == EQUAL or values[room[0], at.EXPECTED] > 0
        lasts = lasts and numbers[g, at.RUN + by] > needed(rules, g, by)
        if lasts or numbers[g, at.AWAY + by] > 0:
            return True
    for kind in range(2):
        if numbers[g, at.AWAY + kind] > 0 or numbers[g, at.RUN + kind] < needed(rules, g, kind):
            continue
        if kind == NEAR and numbers[g, at.CAUSE] == FACTOR:
            continue  # a small factor brings values near to each other
        if kind == NEAR and predicts_too_much(values, room, size):
            continue
        levels = 2 if kind == EQUAL and numbers[g, at.TURNS] > 0 else 1
        never = numbers[g, at.QUIET] == 0 and numbers[g, at.SAMPLES] >= at.KNOWN
        if kind == EQUAL and numbers[g, at.CONTEST] > 0 and never:
            levels = 0
        for k in range(size):
            j = room[k]
            noisy = levels > 0 or near_square(values, numbers, g, j) > 0
            noisy = noisy and not values[j, at.RESTS] > 0
            moved = enough(rules, values, numbers, g, j, kind)
            late = values[j, at.OVERDUE + kind] > patience(values, j, kind)
            late = late or (kind == EQUAL and never)
            if noisy and late and abs(values[j, at.BEYOND + kind]) >= levels * moved:
                if numbers[g, at.CAUSE] != FROZEN:
                    equal = numbers[g, at.RUN + EQUAL] >= numbers[g, at.RUN + kind]
                    numbers[g, at.HELD_BY] = EQUAL if equal else kind
                return True
    return False


@njit(**COLD)
def withdraw(case: Case, g: int, size: int) -> None:
    """The sensor turned out to be frozen: the values of the run lose their effect on the state."""
    (limits, rules, _), (values, numbers, _) = case.settings, case.memory
    room, take, kind = case.sample[0], case.sample[3], numbers[g, at.HELD_BY]
    for k in range(size):
        j = room[k]
        gone = values[j, at.GONE + kind]
        if rules[g, at.USE] != at.NONE and limits[j, at.ADOPTS] > 0:
            take[j] = values[j, at.ORIGIN + kind] + gone
        values[j, at.OFFSET], values[j, at.WAY] = values[j, at.BEFORE + kind], gone
        values[j, at.PATH] = abs(gone)
    numbers[g, at.GOOD_AT] = numbers[g, at.RUN_AT + kind]


@njit(**HOT)
def keep_start(values: Any, numbers: Any, g: int, j: int, row: int) -> None:
    """After the row at which a run began: where the state stood, and how far off it was."""
    for kind in range(2):
        if numbers[g, at.RUN_ROW + kind] == row:
            values[j, at.ORIGIN + kind] = values[j, at.AFTER]
            values[j, at.BEFORE + kind] = values[j, at.OFFSET]
            values[j, at.LEANT + kind] = values[j, at.LEANS]
