"""A pose that is measured off the axle, a base that is carried, lags that are long or one input's.

The bases are simulated here, in fine steps, by none of the package's models.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import CorrectionSpec, ModelSpec, PredictionSpec, Span
from evertwin.correction.search.improve import Proposal, Selection, improve
from evertwin.errors import UsageError
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Differential, Robot1D
from evertwin.models.corrected.corrected import Corrected
from evertwin.models.form import Form, Term
from planted.draws import first_of

FINE, DT, ROWS = 10, 0.1, 1200
KINDS = ("lag", "coupling", "lever", "current")
GAINS = ("gain", "turn_gain")


class Base(NamedTuple):
    """What a base has besides its gain of 0.9."""

    lever: tuple[float, float] = (0.0, 0.0)
    current: tuple[float, float] = (0.0, 0.0)
    lags: tuple[float, float] = (0.0, 0.0)
    """Of speed and of turn rate [s]."""


def driven(base: Base, seed: int, omni: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Commands and poses of the rows."""
    rng = np.random.default_rng(seed)
    held = rng.integers(15, 45, ROWS)
    pick = np.column_stack(
        [rng.uniform(-0.3, 0.6, ROWS), rng.uniform(-0.3, 0.3, ROWS), rng.uniform(-0.8, 0.8, ROWS)]
    )
    u = np.repeat(pick, held, axis=0)[:ROWS]
    u[:, 1] *= omni
    u[:10] = 0.0
    step, pose, speed, poses = DT / FINE, np.zeros(3), np.zeros(3), [np.zeros(3)]
    lags = np.array([base.lags[0], base.lags[0], base.lags[1]])
    share = np.where(lags > 0.0, 1.0 - np.exp(-step / np.where(lags > 0.0, lags, 1.0)), 1.0)
    for row in u[1:]:
        for _ in range(FINE):
            speed += share * (0.9 * row - speed)
            middle = pose[2] + 0.5 * step * speed[2]
            c, s = np.cos(middle), np.sin(middle)
            pose[0] += step * (c * speed[0] - s * speed[1] + base.current[0])
            pose[1] += step * (s * speed[0] + c * speed[1] + base.current[1])
            pose[2] += step * speed[2]
        poses.append(pose.copy())
    y = np.array(poses)
    c, s = np.cos(y[:, 2]), np.sin(y[:, 2])
    ahead, aside = base.lever
    y[:, 0] += c * ahead - s * aside
    y[:, 1] += s * ahead + c * aside
    y += rng.normal(size=y.shape) * (0.002, 0.002, 0.002)
    return (u if omni else u[:, ::2]), y


def block(u: np.ndarray, y: np.ndarray) -> Block:
    return make_block(t=np.arange(len(u)) * round(DT * 1e9), u=u, y=y)


def learned(
    base: Base, seed: int, horizon: float = 1.0, kinds: tuple[str, ...] = KINDS
) -> Proposal:
    settings = Selection(kinds, numbers=GAINS, beside=True)
    return improve(Differential(), Form(), (block(*driven(base, seed)),), horizon, settings)


def numbers(found: Proposal) -> dict[str, float]:
    return dict(zip(found.names, found.p.tolist(), strict=True))


@pytest.mark.parametrize("horizon", [0.5, 1.0, 2.0])
@first_of("seed", range(3))
def test_a_marker_off_the_axle_is_named_where_it_is(seed: int, horizon: float) -> None:
    rng = np.random.default_rng(seed)
    lever = float(rng.uniform(0.1, 0.3)), float(rng.uniform(-0.1, 0.1))
    found = learned(Base(lever), seed, horizon)
    assert [term.kind for term in found.form.terms] == ["lever"]
    p = numbers(found)
    assert (p["lever.ahead"], p["lever.aside"]) == pytest.approx(lever, abs=0.004)
    assert p["gain"] == pytest.approx(0.9, abs=0.005)
    assert found.describes[0].startswith("pose: measured")


@pytest.mark.parametrize("horizon", [0.5, 1.0, 2.0])
@first_of("seed", range(3))
def test_a_current_is_named_with_its_axes(seed: int, horizon: float) -> None:
    way = np.random.default_rng(seed).uniform(-3.0, 3.0)
    current = float(0.08 * np.cos(way)), float(0.08 * np.sin(way))
    found = learned(Base(current=current), seed, horizon)
    assert [term.kind for term in found.form.terms] == ["current"]
    p = numbers(found)
    assert (p["current.x"], p["current.y"]) == pytest.approx(current, abs=0.004)


def test_both_are_told_from_a_lag_and_from_each_other() -> None:
    found = learned(Base((0.2, -0.05), (0.05, 0.06), (0.3, 0.3)), 1)
    assert sorted(term.kind for term in found.form.terms) == ["current", "lag", "lever"]
    p = numbers(found)
    assert p["lever.ahead"] == pytest.approx(0.2, abs=0.01)
    assert p["current.y"] == pytest.approx(0.06, abs=0.01)
    assert p["lag.tau"] + p["lag.delay"] == pytest.approx(0.3, abs=0.06)


@first_of("seed", range(10))
def test_a_base_that_has_none_of_it_is_told_of_none(seed: int) -> None:
    assert not learned(Base(), seed).found
    late = learned(Base(lags=(0.3, 0.3)), seed)
    assert {term.kind for term in late.form.terms} == {"lag"}


def test_a_lag_may_be_longer_than_a_prediction() -> None:
    found = learned(Base(lags=(2.5, 2.5)), 0, kinds=("lag",))
    assert numbers(found)["lag.tau"] == pytest.approx(2.5, rel=0.02)


def test_a_lag_that_ends_where_its_search_ended_says_so() -> None:
    found = learned(Base(lags=(1.5, 1.5)), 0, horizon=0.1, kinds=("lag",))
    assert numbers(found)["lag.tau"] == pytest.approx(1.0)
    assert found.describes[0].endswith("tau where the search ended: it may lie beyond")


def test_an_input_that_answers_later_than_the_others_has_a_lag_of_its_own() -> None:
    found = learned(Base(lags=(0.6, 0.1)), 0, kinds=("lag",))
    p = numbers(found)
    own = {name.rsplit(".", 1)[0] for name in p if name.startswith("lag.")}
    assert len(own) == 2
    late = sum(value for name, value in p.items() if name.startswith("lag.") and ".w." not in name)
    assert late == pytest.approx(0.6, abs=0.12)


def test_a_line_has_no_pose_to_be_off() -> None:
    u = np.repeat([[0.1], [0.2], [0.0], [0.3]], 100, axis=0)
    rows = make_block(t=np.arange(400) * 10**8, u=u, y=0.08 * u.cumsum(axis=0))
    assert not improve(Robot1D(), Form(), (rows,), 1.0, Selection(("lever", "current"))).found
    with pytest.raises(UsageError, match="hold a pose x, y, heading, got"):
        Corrected(Robot1D(), (Term("lever", "*"),))


@first_of("omni", [True, False])
def test_a_run_names_it_and_the_doctor_did_before(omni: bool) -> None:
    u, y = driven(Base((0.2, 0.06), (0.05, -0.04)), 3, omni)
    names = ("v", "w") if not omni else ("vx", "vy", "w")
    columns = dict(zip((*names, "x", "y", "heading"), np.column_stack([u, y]).T, strict=True))
    rows = {"t": DT * np.arange(ROWS), **columns}
    twin = TwinSpec(
        "base", ModelSpec("omni" if omni else "differential"), prediction=PredictionSpec(1.0),
        anomaly=AnomalySpec(requirement=0.01, relative=False, window=Span(seconds=20.0)),
        correction=CorrectionSpec(channels=names, terms=KINDS),
    )  # fmt: skip
    with Twin(twin) as one:
        told = {found.kind: found.reason for found in one.doctor(rows).findings}
        result = one.run(rows)
    assert "of the point about which the base turns" in told["lever"]
    assert "m/s in x" in told["current"]
    p = dict(zip(result.champion.names, result.champion.values, strict=True))
    assert (p["lever.ahead"], p["lever.aside"]) == pytest.approx((0.2, 0.06), abs=0.01)
    assert (p["current.x"], p["current.y"]) == pytest.approx((0.05, -0.04), abs=0.01)
    assert "pose: measured" in str(result) and "pose: carried by" in str(result)
