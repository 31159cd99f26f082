"""A model that describes nothing yet names no unit of a sensor whose values go on smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import Block, Event, make_block
from evertwin.machines.drive import Drive
from evertwin.sync import Arbiter, Rule, Track
from evertwin.sync import places as at
from evertwin.sync.arbiter.factor_loop import weigh
from evertwin.sync.arbiter.plausible_loop import in_scale, stands_out

from .machines import store, unicycle

ROWS = 4000


def served(seed: int) -> Block:
    """An axis that is moved to a place and rests there, again and again, and its coarse encoder."""
    rng = np.random.default_rng(seed)
    dt, step, moves = rng.choice([0.002, 0.005, 0.02]), rng.choice([1e-5, 1e-4]), [np.zeros(5)]
    while sum(map(len, moves)) < ROWS:
        to, share = rng.uniform(-0.5, 0.5), np.linspace(0, 1, int(rng.uniform(0.3, 1.5) / dt))
        way = 10 * share**3 - 15 * share**4 + 6 * share**5
        moves += [moves[-1][-1] + (to - moves[-1][-1]) * way, np.full(int(0.4 / dt), to)]
    place = np.concatenate(moves)[:ROWS]
    read = np.round((place + rng.normal(size=ROWS) * step / 2) / step) * step
    stamps = (np.arange(ROWS) * dt * 1e9).astype(np.int64)
    return make_block(t=stamps, u=np.roll(place, -5)[:, None], y=read[:, None])


def factors(block: Block, **limits: float) -> list[tuple[int, float]]:
    """Row and factor of every unit that is named, with a model of another kind."""
    stage = Track(store(**limits), Arbiter(Rule(use="blend")))
    events = [e for e in stage.step(stage.init(), block)[1].records if isinstance(e, Event)]
    return [
        (int(str(e.evidence["onset"])), float(str(e.evidence["factor"])))
        for e in events
        if e.kind == "measurement_error" and e.evidence["cause"] == "factor"
    ]


def test_motion_that_the_model_does_not_know_is_no_unit() -> None:
    assert [factors(served(seed)) for seed in range(30)] == [[]] * 30


@pytest.mark.parametrize("limits", [{}, {"rate": 20.0}], ids=["", "faster than it can be"])
@pytest.mark.parametrize("factor", [1000.0, 0.01, 25.4])
def test_a_leap_by_a_factor_is_one(factor: float, limits: dict[str, float]) -> None:
    told = 0
    for seed in range(20):
        block = served(seed)
        onset = 2000 + int(np.argmax(np.abs(block.y[2000:, 0]) > 0.1))
        block.y[onset:] *= factor
        found = [f for row, f in factors(block, **limits) if abs(row - onset) < 3]
        told += found[:1] == pytest.approx([factor])
    assert told >= 15 - len(limits), told  # the rest leaps while the machine moves fast


@pytest.mark.parametrize("factor", [1000.0, 1 / 0.0254, 10.0])
def test_a_unit_that_stays_is_told_until_it_is_back(factor: float) -> None:
    """Of a pose whose x alone changes, while the prediction drifts away by its wrong gain."""
    held = back = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        v, w = (np.repeat(rng.uniform(low, 0.5, 60), 50) for low in (-0.1, -0.5))
        heading = np.cumsum(w) * 0.1
        pose = np.stack([np.cumsum(v * np.cos(heading)), np.cumsum(v * np.sin(heading))]) * 0.1
        y = np.column_stack([*pose, heading]) + rng.normal(size=(3000, 3)) * 0.003
        y[1600:2300, 0] *= factor
        stamps = np.arange(3000) * 10**8
        block = make_block(t=stamps, u=np.column_stack([v, w]), y=y)
        stage = Track(unicycle(0.9), Arbiter(Rule(use="blend")))
        events = [e for e in stage.step(stage.init(), block)[1].records if isinstance(e, Event)]
        ends = [e.row for e in events if e.kind == "measurement_restored" and e.row > 1650]
        held += ends[:1] >= [2300]
        back += 2300 <= ends[0] < 2320 if ends else 0
    assert min(held, back) >= 18, (held, back)


def test_a_friction_that_no_model_knows_is_no_unit() -> None:
    """A torque of which the model expects what gravity is: now and then friction makes it 8.85
    times that, as inch pounds would."""
    rng, limits, values = (
        np.random.default_rng(2),
        np.zeros((1, at.TRIED)),
        np.zeros((1, at.VALUES)),
    )
    values[0, at.SQUARE] = np.inf
    for gravity in 5.0 * np.sin(np.arange(2000) / 90.0):
        weigh(limits, values, 0, gravity + rng.choice([-4.0, 4.0]), gravity)
    assert in_scale(limits, values, 0)
    assert not stands_out(limits, values, 0, 4.0)
    assert stands_out(limits, values, 0, 7.85 * 4.0)


def pushed(seed: int) -> Block:
    """A cart that stands while its force is measured as noise, and is pushed from then on."""
    rng = np.random.default_rng(seed)
    mass, size = rng.uniform(3.0, 40.0), rng.uniform(1.0, 4.0)
    steps = np.repeat(rng.uniform(-1, 1, 100), rng.integers(50, 200, 100))[: ROWS - 300]
    force = mass * size * np.concatenate([np.zeros(300), steps])
    x = np.zeros((ROWS, 2))
    for k in range(1, ROWS):
        v = x[k - 1, 1] + 0.01 * (force[k] / mass - x[k - 1, 1])
        x[k] = x[k - 1, 0] + 0.01 * v, v
    y = x + rng.normal(size=x.shape) * [0.002, 0.01]
    read = force + rng.normal(0.0, 0.005 * mass * size, ROWS)
    return make_block(t=np.arange(ROWS) * 10**7, u=read[:, None] / mass, y=y)


@pytest.mark.parametrize("mass", [0.07, 0.3, 1.0, 10.0])
def test_the_first_push_of_a_cart_is_in_no_other_unit(mass: float) -> None:
    """However far off the first guess of its mass is; the noise at rest is no range."""
    told = 0
    for seed in range(10):
        block = pushed(seed)
        stage = Track(Drive(), Arbiter(Rule(use="blend")))
        start = stage.renew(stage.init(), np.array([mass, mass, 0.0, 0.0]))
        events = [e for e in stage.step(start, block)[1].records if isinstance(e, Event)]
        told += any(e.signal == "force" for e in events)
    assert told == 0
