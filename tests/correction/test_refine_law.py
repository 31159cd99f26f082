"""Planted laws and lags are found again; the variant is chosen by data."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from evertwin.correction.describe import describe
from evertwin.correction.stack import stack_of
from evertwin.correction.translation import refine_law as module
from evertwin.correction.translation.refine_law import Refined, refine_law
from evertwin.correction.translation.sarsa import learn_table
from evertwin.correction.translation.sarsa_settings import SarsaSettings
from evertwin.errors import DataError
from evertwin.fold import Block, make_block, take
from evertwin.machines.mobile import Robot1D
from evertwin.models import FunctionModel, Parameters
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.form import Form, Term
from evertwin.models.terms.registry import kind
from evertwin.signals import Layout

ROBOT = Robot1D()
P = ROBOT.parameters.values


def goal(command: np.ndarray, variant: str) -> np.ndarray:
    linear = np.minimum(0.97 * command + 0.002, 0.16)
    if variant == "dead zone":
        return np.where(command <= 0.06, 0.0, linear)
    if variant == "clamp":
        return np.where(command < 0.005, 0.0, np.maximum(linear, 0.06))
    return linear


def record(variant: str, tau: float, seed: int = 0, noise: float = 0.002) -> Block:
    """A shuffled sweep of 100 s after three seconds at rest, position at 1 Hz."""
    rng = np.random.default_rng(seed)
    command = np.r_[np.zeros(3), np.repeat(rng.permutation(np.arange(1, 21)) * 0.01, 5)]
    aim, v, way = goal(command, variant), 0.0, np.zeros(len(command))
    decay = np.exp(-1.0 / tau)
    for k, target in enumerate(aim):
        way[k] = target + (v - target) * tau * (1.0 - decay)
        v = target + (v - target) * decay
    way += noise * rng.standard_normal(len(way))
    y = np.cumsum(way) + noise * rng.standard_normal(len(way))
    return make_block(t=np.arange(len(y)) * 10**9, u=command[:, None], y=y[:, None])


def refined(rows: Block) -> Refined:
    table = learn_table(ROBOT, P, (rows,), SarsaSettings("v"))
    return refine_law(ROBOT, P, (rows,), table, 1.0)


@pytest.mark.parametrize("variant", ["dead zone", "clamp"])
@pytest.mark.parametrize("tau", [0.05, 0.2])
@pytest.mark.parametrize("seed", range(3))
def test_the_planted_law_is_found(variant: str, tau: float, seed: int) -> None:
    found = refined(record(variant, tau, seed))
    assert found.variant == variant
    assert found.threshold == pytest.approx(0.06, abs=0.003)
    assert found.cap == pytest.approx(0.16, abs=0.003)
    assert found.tau == pytest.approx(tau, abs=0.06)
    assert found.rms < 0.005


def test_a_linear_drive_gets_no_threshold() -> None:
    found = refined(record("", 0.1, 2))
    assert found.variant == ""
    assert found.threshold == 0.0
    assert found.values["law.v.gain"] == pytest.approx(0.97, abs=0.05)


def test_the_terms_make_a_model_that_predicts() -> None:
    found = refined(record("dead zone", 0.2, 1))
    corrected = Corrected(ROBOT, found.terms)
    p = corrected.parameters.with_values({**dict(found.values)}).values
    unseen = record("dead zone", 0.2, 9, noise=0.0)
    _, y = corrected.simulate(corrected.initial(p), unseen.u, np.ones(len(unseen.t)), p)
    _, naive = ROBOT.simulate(ROBOT.initial(P), unseen.u, np.ones(len(unseen.t)), P)
    assert np.sqrt(np.mean((y - unseen.y) ** 2)) < 0.1
    assert np.sqrt(np.mean((naive - unseen.y) ** 2)) > 0.5


def test_the_findings_are_said_in_words() -> None:
    found = refined(record("clamp", 0.1, 4))
    stack = stack_of(ROBOT, Form(found.terms), np.array([*P, *found.values.values()]))
    said = ", ".join(describe(stack)).split(", ")
    assert said[0].startswith("v: start threshold 0.0")
    assert said[0].endswith("m/s (clamp)")
    assert any("saturation at 0.1" in sentence for sentence in said)


def test_too_few_rows_are_refused() -> None:
    rows = record("clamp", 0.1)
    table = learn_table(ROBOT, P, (rows,), SarsaSettings("v"))
    with pytest.raises(DataError, match="at least 12"):
        refine_law(ROBOT, P, (take(rows, 0, 8),), table, 1.0)


def test_a_gain_of_nothing_is_told_as_no_answer() -> None:
    """The sign of a command may be turned: the best that a law without negative gain can do."""
    law, term = kind("law"), Term("law", "w")
    said = [law.say(term, (gain, 0.0, 1e9), "rad/s", {}) for gain in (1e-16, 0.9)]
    assert said == ["w: no answer to it (or its sign is turned)", "w: gain 0.9"]


@pytest.mark.parametrize("variant", ["", "dead zone", "clamp"])
@pytest.mark.parametrize("seed", range(2))
def test_what_falls_back_is_not_fitted_to_its_end(
    variant: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The law is that of fits that all go on; with a threshold at half of their roll-outs."""
    found, count = [], [0, 0]
    for k, race in enumerate((module.RACE, ((10_000, 10.0),))):
        own = module._Trial._residual

        def counted(self: module._Trial, q: np.ndarray, k: int = k, own: Any = own) -> np.ndarray:
            count[k] += 1
            return np.asarray(own(self, q))

        with monkeypatch.context() as patch:
            patch.setattr(module, "RACE", race)
            patch.setattr(module._Trial, "_residual", counted)
            found.append(refined(record(variant, 0.2, seed)))
    assert found[0].variant == found[1].variant == variant
    assert found[0].values == found[1].values
    assert count[0] < (0.5 if variant else 1.0) * count[1], count


def test_the_end_of_a_dead_zone_is_found_among_many_commands() -> None:
    """Every command is another one: 600 of them near the edge."""
    rng = np.random.default_rng(0)
    command = np.repeat(rng.uniform(0.01, 0.2, 800), 3)
    way = goal(command, "dead zone") + 0.001 * rng.standard_normal(len(command))
    rows = make_block(
        t=np.arange(len(command)) * 10**9, u=command[:, None], y=np.cumsum(way)[:, None]
    )
    found = refined(rows)
    assert found.variant == "dead zone"
    last = command[command <= 0.06].max()
    assert last - 0.001 <= found.threshold <= 0.06


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_a_model_without_a_value_at_some_numbers_is_refined(scale: float) -> None:
    """A valve that lets nothing through below 3 %, where the model divides by what is left."""

    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        left = u[0] - 0.03
        place = x[0] + dt * p[0] / (1.0 + 0.1 / left) if left > 0.0 else math.nan
        return [place], [place]

    model = FunctionModel(
        step, Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"),
        Parameters.of(gain=(scale, "m/s")),
    )  # fmt: skip
    p = model.parameters.values
    rng = np.random.default_rng(4)
    command = np.repeat(rng.permutation(np.arange(5, 25)) * 0.01, 6)
    left = np.maximum(0.9 * command - 0.055, 1e-9)  # two commands let nothing through any more
    moved = scale / (1.0 + 0.1 / left)
    y = np.cumsum(moved) + 1e-4 * scale * rng.standard_normal(len(moved))
    rows = make_block(t=np.arange(len(y)) * 10**9, u=command[:, None], y=y[:, None])
    table = learn_table(model, p, (rows,), SarsaSettings("v"))
    found = refine_law(model, p, (rows,), table, 1.0)
    assert found.values["law.v.gain"] == pytest.approx(0.9, abs=0.1)
    assert found.rms < 0.05 * scale
