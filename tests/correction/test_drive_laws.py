"""Drives that are not like the textbook: each wheel, each direction, hysteresis, a rate limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.correction.numbers.slides import slid_numbers
from evertwin.correction.search.improve import Proposal, Selection, improve
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Differential, Robot1D
from evertwin.models.form import Form, Term
from planted.draws import first_of

DT, HOLD = 0.2, 15
KINDS = ("lag", "slew", "coupling", "law", "direction", "hysteresis", "wheels")
LINE = ("lag", "slew", "law", "direction", "hysteresis")


def held(rng: np.random.Generator, reach: tuple[float, ...], count: int = 80) -> np.ndarray:
    """Commands of either sign, each for 3 s, (n, inputs)."""
    return np.repeat(rng.uniform(-1.0, 1.0, (count, len(reach))) * reach, HOLD, axis=0)


def recorded(u: np.ndarray, y: np.ndarray) -> Block:
    return make_block(t=np.arange(len(u)) * round(DT * 1e9), u=u, y=y)


def on_a_line(seed: int, law: str) -> Block:
    """A robot that starts at 0.06 m/s forwards and 0.1 backwards, or stops at 0.03 only, or takes
    time for a change of its speed; or has a dead zone and lags behind."""
    rng = np.random.default_rng(seed)
    u, now, speeds = held(rng, (0.2,)), 0.0, []
    for v in u[:, 0].tolist():
        if law == "direction":
            now = v if v > 0.06 or v < -0.1 else 0.0
        elif law == "hysteresis":
            now = v if abs(v) > (0.03 if now * v > 0.0 else 0.08) else 0.0
        elif law == "lag":
            now += (1.0 - np.exp(-DT / 0.3)) * (v * (abs(v) > 0.06) - now)
        else:
            now += float(np.clip(v - now, -0.08 * DT, 0.08 * DT))
        speeds.append(now)
    y = DT * np.cumsum(speeds) + rng.normal(0.0, 2e-3, len(u))
    return recorded(u, y[:, None])


def on_wheels(seed: int, left: float, right: float, track: float = 0.4) -> Block:
    """A base whose wheels start at speeds of their own."""
    rng = np.random.default_rng(seed)
    u = held(rng, (0.4, 1.0))
    a, b = u[:, 0] - 0.5 * track * u[:, 1], u[:, 0] + 0.5 * track * u[:, 1]
    a, b = np.where(np.abs(a) > left, a, 0.0), np.where(np.abs(b) > right, b, 0.0)
    return moved(rng, u, a, b, track)


def limited(command: np.ndarray, rate: float, braking: float = 1.0, tau: float = 0.0) -> np.ndarray:
    """Mean speed over each row of a drive that takes time for a change, and lags behind by tau."""
    fine, now, behind, out = 40, 0.0, 0.0, []
    step = DT / fine
    for goal in np.repeat(command, fine).tolist():
        slows = now * goal < 0.0 or abs(goal) < abs(now)
        way = rate * (braking if slows else 1.0) * step
        now += float(np.clip(goal - now, -way, way))
        behind += (now - behind) * (1.0 - np.exp(-step / tau) if tau else 1.0)
        out.append(behind)
    return np.reshape(out, (-1, fine)).mean(axis=1)


def on_slow_wheels(seed: int, rate: float, braking: float, tau: float) -> Block:
    """A base whose wheels take time for a change of their speeds."""
    rng = np.random.default_rng(seed)
    u = held(rng, (0.4, 1.0), 40)
    wheels = (u[:, 0] + side * 0.2 * u[:, 1] for side in (-1.0, 1.0))
    return moved(rng, u, *(limited(one, rate, braking, tau) for one in wheels), 0.4)


def moved(
    rng: np.random.Generator, u: np.ndarray, a: np.ndarray, b: np.ndarray, track: float
) -> Block:
    """The recording of a base whose left and right wheel go at these speeds."""
    v, turn = 0.5 * (a + b), DT * (b - a) / track
    heading = np.cumsum(turn)
    way = DT * v * np.stack([np.cos(heading - 0.5 * turn), np.sin(heading - 0.5 * turn)])
    y = np.column_stack([*np.cumsum(way, axis=1), heading])
    y += rng.normal(0.0, (3e-3, 3e-3, 4e-3), y.shape)
    y[:, 2] = np.angle(np.exp(1j * y[:, 2]))
    return recorded(u, y)


def stands(u: np.ndarray, track: float, left: float, right: float) -> np.ndarray:
    """Rows on which the left and the right wheel stand, (n, 2)."""
    side = 0.5 * track * u[:, 1]
    return np.abs(np.stack([u[:, 0] - side, u[:, 0] + side], axis=1)) <= (left, right)


def numbers(found: Proposal) -> dict[str, float]:
    return dict(zip(found.names, found.p.tolist(), strict=True))


@pytest.mark.parametrize(
    ("law", "kind", "expected"),
    [
        ("direction", "direction", {"forward": 0.06, "backward": 0.1}),
        ("hysteresis", "hysteresis", {"start": 0.08, "stop": 0.03}),
        ("rate", "slew", {"rate": 0.08}),
    ],
)
@first_of("seed", range(4))
def test_the_law_of_a_drive_is_named(
    law: str, kind: str, expected: dict[str, float], seed: int
) -> None:
    found = improve(Robot1D(), Form(), (on_a_line(seed, law),), 1.0, Selection(LINE))
    assert [term.kind for term in found.form.terms] == [kind]
    p = numbers(found)
    for name, value in expected.items():
        assert p[f"{kind}.v.{name}"] == pytest.approx(value, abs=0.01)


@first_of("seed", range(4))
def test_a_dead_zone_behind_a_lag_is_no_hysteresis(seed: int) -> None:
    found = improve(Robot1D(), Form(), (on_a_line(seed, "lag"),), 1.0, Selection(LINE))
    assert [term.kind for term in found.form.terms] == ["law", "lag"]
    assert numbers(found)["law.v.threshold"] == pytest.approx(0.06, abs=0.01)


@first_of("seed", range(4))
def test_each_wheel_has_its_own_start(seed: int) -> None:
    rows = on_wheels(seed, 0.06, 0.12)
    found = improve(Differential(), Form(), (rows,), 1.0, Selection(("wheels", "law")))
    assert [term.kind for term in found.form.terms] == ["wheels"]
    p = numbers(found)
    track, left, right = (p[f"wheels.v.w.{name}"] for name in ("track", "left", "right"))
    assert track == pytest.approx(0.4, rel=0.03)
    assert (left, right) == (pytest.approx(0.06, abs=0.015), pytest.approx(0.12, abs=0.015))
    wrong = stands(rows.u, track, left, right) != stands(rows.u, 0.4, 0.06, 0.12)
    assert wrong.sum() <= HOLD  # one command


def test_a_base_as_it_is_told_has_no_such_law() -> None:
    found = improve(Differential(), Form(), (on_wheels(5, 0.0, 0.0),), 1.0, Selection(KINDS))
    assert not found.found


def test_a_threshold_that_was_known_badly_is_brought_back() -> None:
    form = Form((Term("direction", "v"),))
    p = np.array([1.0, 0.02, 0.05, 1.0, 1.0, 1e9])
    rows = (on_a_line(0, "direction"),)
    found = slid_numbers(Robot1D(), form, p, rows, 1.0)
    assert found[1:3] == pytest.approx([0.06, 0.1], abs=0.01)
    assert found[3:5] == pytest.approx([1.0, 1.0], rel=0.05)
    bare = np.array([1.0])
    assert slid_numbers(Robot1D(), Form(), bare, rows, 1.0) is bare


@first_of(
    ("braking", "tau", "seed"),
    [(a, b, s) for a, b in ((1.0, 0.3), (1.0, 0.0), (2.5, 0.0)) for s in range(4)],
)
def test_a_rate_limit_of_each_wheel_is_told_with_its_lag(
    braking: float, tau: float, seed: int
) -> None:
    rows = on_slow_wheels(seed, 0.25, braking, tau)
    found = improve(Differential(), Form(), (rows,), 1.0, Selection(("lag", "slew")))
    shape = "braking" if braking != 1.0 else ""
    terms = [Term("slew", "v", "w", shape), *[Term("lag", "*")] * (tau > 0.0)]
    assert [replace(term, levels=()) for term in found.form.terms] == terms
    p = numbers(found)
    assert p["slew.v.w.track"] == pytest.approx(0.4, rel=0.1)
    assert p["slew.v.w.rate"] == pytest.approx(0.25, rel=0.05)
    assert p.get("slew.v.w.braking", 1.0) == pytest.approx(braking, rel=0.15)
    assert p.get("lag.tau", 0.0) + p.get("lag.delay", 0.0) == pytest.approx(tau, abs=0.04)


@first_of("seed", range(4))
def test_a_lag_within_a_row_is_no_delay_and_no_rate_limit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = held(rng, (0.2,))
    y = DT * limited(u[:, 0], 1e3, tau=0.1).cumsum() + rng.normal(0.0, 1e-3, len(u))
    rows = (recorded(u, y[:, None]),)
    found = improve(Robot1D(), Form(), rows, 1.0, Selection(("lag", "slew"), least=10))
    assert [term.kind for term in found.form.terms] == ["lag"]
    p = numbers(found)
    assert p["lag.delay"] == 0.0
    assert p["lag.tau"] == pytest.approx(0.1, abs=0.01)
