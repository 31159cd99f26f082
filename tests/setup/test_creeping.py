"""The speed below which friction sticks belongs to a drive: nobody can say it for all."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config import TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.fold import Block, make_block
from evertwin.machines.drive import DriveForce
from evertwin.setup.friction_law import Chosen, acting, climb_laws
from evertwin.tuning import Problem, solve
from evertwin.tuning.spec import TuningSpec

TOP = {"slow": 0.02, "fast": 5.0}
LAW = "sign+direction+two_sided+stribeck+root"
SHARE = 0.06
"""Of the fastest speed, at which the peak has fallen to 1/e."""


def moved(top: float, seed: int, back: float = 1.0) -> Block:
    """Moves of a drive there and back, some at creep; ``back``: of its speed forwards."""
    rng, v = np.random.default_rng(seed), []
    while len(v) < 3000:
        speed = top * rng.choice([0.01, 0.03, 0.06, 0.12, 0.3, 0.6, 1.0])
        rise, flat = np.sin(np.linspace(0, np.pi / 2, 25)), np.ones(int(rng.integers(20, 80)))
        shape = speed * np.concatenate([rise, flat, rise[::-1], np.zeros(5)])
        v += [*shape, *(-back * shape)]
    speed = np.array(v[:3000])
    acceleration = np.gradient(speed, 0.02)
    dry = (20.0 + 9.0 * np.exp(-((speed / (SHARE * top)) ** 2))) * np.sign(speed)
    force = 40.0 / top * acceleration * 0.05 + 12.0 / top * speed + dry + 1.5
    seen = force + 0.8 * rng.standard_normal(3000)
    t, motion = 20_000_000 * np.arange(3000), np.stack([speed, acceleration], axis=1)
    return make_block(t=t, u=motion, y=seen[:, None])._replace(task=np.full(3000, seed))


def twin() -> Twin:
    ladder = tuple(LAW.split("+")[1:])
    model = ModelSpec("drive_force", options={"law": LAW})
    return Twin(TwinSpec("axis", model, tuning=TuningSpec(ladder=ladder)))


@pytest.mark.parametrize("kind", ["slow", "fast"])
def test_a_peak_is_found_where_the_drive_has_it(kind: str) -> None:
    top = TOP[kind]
    found = twin().fit([moved(top, seed) for seed in range(4)])
    assert found.laws == {"force": "sign+stribeck"}
    values = {item.name: item.value for item in found.parameters}
    assert values["vs"] == pytest.approx(SHARE * top, rel=0.2)
    assert values["Fs"] == pytest.approx(9.0, rel=0.1)
    assert "vs 0" in found.causes["force"] and "m/s" in found.causes["force"]


def test_a_drive_that_stands_has_a_peak_at_no_speed() -> None:
    still = moved(1.0, 0)._replace(u=np.zeros((3000, 2)))
    axis = twin()
    problem = axis.problem([still])
    assert climb_laws(axis.setup, problem)[0].parameters["vs"].value > 0.0


def test_what_is_learned_of_slow_ways_back_holds_for_fast_ones() -> None:
    """Friction that falls with speed looks like one that is negative, seen creeping alone."""
    axis = twin()
    version = axis.keep(axis.fit([moved(0.5, seed, back=0.2) for seed in range(4)]))
    both = axis.fit([moved(0.5, seed) for seed in range(4, 7)], test=[moved(0.5, 9)])
    now = dict(zip(version.names, version.values, strict=True))
    assert now["Fc"] + (now["Fv"] + now["Fv_back"]) * 0.5 > 0.0
    assert both.laws == {"force": "sign+stribeck"}


def test_a_term_whose_number_stays_at_zero_is_none_of_the_law() -> None:
    problem = Problem(DriveForce(LAW), (moved(0.5, 1),), ("mass", "Fv", "Fc", "offset", "Fs", "Fr"))
    fit, place = solve(problem), problem.model.parameters.index("Fr")
    taken = Chosen(taken=(("stribeck", "root"),))
    assert acting(taken, problem, fit).laws == {"force": "sign+stribeck+root"}
    fit.p[place] = 0.0
    found = acting(taken, problem, fit)
    assert found.laws == {"force": "sign+stribeck"}
    assert "Fs" not in fit.identifiable and not found.causes, "nothing is told of a weak number"
    assert acting(Chosen(), problem, fit) == Chosen()


def test_a_term_that_no_ladder_tries_is_of_the_law_too() -> None:
    model = ModelSpec("drive_force", options={"law": LAW})
    axis = Twin(TwinSpec("axis", model, tuning=TuningSpec(ladder=("root",))))
    found = axis.fit([moved(TOP["fast"], seed) for seed in range(4)])
    assert set(found.laws["force"].split("+")) == set(LAW.split("+")) - {"root"}
    assert {item.name: item.value for item in found.parameters}["Fs"] > 5.0


@pytest.mark.parametrize("width", [0.003, 0.03])
def test_the_width_of_a_smooth_switch_is_found_where_nobody_says_it(width: float) -> None:
    """A drive may creep wholly within the width that stands for one that nobody has said."""
    ladder = TuningSpec(ladder=("direction",))
    axis = Twin(
        TwinSpec("axis", ModelSpec("drive_force", options={"law": "tanh+direction"}), tuning=ladder)
    )

    def crept(seed: int) -> Block:
        rows = moved(5.0 * width, seed)
        v, a = rows.u.T
        rng = np.random.default_rng(seed)
        force = 40.0 * a + 3.0 * v + 20.0 * np.tanh(v / width) + rng.normal(0.0, 0.8, len(v))
        return rows._replace(y=force[:, None])

    found = axis.fit([crept(seed) for seed in range(3)])
    values = {item.name: item.value for item in found.parameters}
    assert values["width"] == pytest.approx(width, rel=0.1)
    assert values["Fc"] == pytest.approx(20.0, rel=0.03)
