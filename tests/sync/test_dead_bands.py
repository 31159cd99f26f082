"""A historian repeats a value until it moves by more than a dead band: sound, unlike a freeze."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import fold, make_block
from evertwin.models import FunctionModel
from evertwin.signals import Layout
from evertwin.sync import Arbiter, Rule, Track

ROWS, AT = 1600, 1100


def oven(rng: np.random.Generator) -> tuple[FunctionModel, np.ndarray, np.ndarray]:
    """A heated body of 10 to 100 rows, 5 % off, whose model has no lag of its sensor."""
    slow = 10.0 ** rng.uniform(1.0, 2.0)
    keeps, true = np.exp(-1.0 / slow), np.exp(-1.0 / (slow * rng.uniform(0.95, 1.05)))
    u = np.repeat(rng.uniform(0.0, 10.0, 40), int(1.5 * slow) + 20)[:ROWS]
    u, y, x, seen = np.resize(u, ROWS), np.empty(ROWS), u[0], u[0]
    for k in range(ROWS):
        x = u[k] + (x - u[k]) * true
        y[k] = seen = seen + 0.6 * (x - seen)
    model = FunctionModel(
        lambda x, u, dt, p: ((z := [u[0] + (x[0] - u[0]) * keeps]), z),
        Layout.of(u="K"), Layout.of(y="K"), Layout.of(y="K"),
    )  # fmt: skip
    return model, u, y


def cart(rng: np.random.Generator) -> tuple[FunctionModel, np.ndarray, np.ndarray]:
    """A way by a speed that is 2 % off and often zero."""
    u = np.resize(np.repeat(0.1 * rng.uniform(-1.0, 1.0, 60), 40), ROWS)
    u[np.resize(np.repeat(rng.random(40) < 0.3, 60), ROWS)] = 0.0
    model = FunctionModel(
        lambda x, u, dt, p: ((z := [x[0] + u[0]]), z),
        Layout.of(u="m/s"), Layout.of(y="m"), Layout.of(y="m"),
    )  # fmt: skip
    return model, u, np.cumsum(1.02 * u)


def force(rng: np.random.Generator) -> tuple[FunctionModel, np.ndarray, np.ndarray]:
    """What no state keeps, by an input that wanders."""
    u = 5.0 + np.convolve(rng.normal(0.0, 1.0, ROWS + 29), np.ones(30) / 6.0, "valid")
    model = FunctionModel(
        lambda x, u, dt, p: ([], [u[0]]), Layout.of(u="A"), Layout.of(y="N"), Layout()
    )
    return model, u, 1.02 * u


def recorded(true: np.ndarray, band: float, quantum: float) -> np.ndarray:
    """As a historian keeps it."""
    seen, last = quantum * np.round(true / quantum), np.inf
    for k, value in enumerate(seen):
        seen[k] = last = value if abs(value - last) > band else last
    return seen


@pytest.mark.parametrize("machine", [oven, cart, force])
@pytest.mark.parametrize("fault", ["held", "dither", "at two values"])
def test_held_by_a_dead_band_is_not_frozen(machine: object, fault: str) -> None:
    accused, found, could = 0, 0, 0
    for seed in range(25):
        rng = np.random.default_rng([seed, 7])
        model, u, true = machine(rng)  # type: ignore[operator]
        sigma = 10.0 ** rng.uniform(-2.0, -0.7)
        band, quantum = sigma * rng.uniform(0.5, 6.0), sigma * 10.0 ** rng.uniform(-1.0, 0.4)
        raw = true + rng.normal(0.0, sigma, ROWS)
        frozen = raw.copy()
        frozen[AT:] = raw[AT]
        if fault == "dither":
            frozen[AT:] += rng.normal(0.0, 0.15 * sigma, ROWS - AT)
        if fault == "at two values":
            frozen[AT::2] += max(quantum, 0.5 * sigma)
        block = make_block(
            np.arange(ROWS) * 10**9, u[:, None], recorded(frozen, band, quantum)[:, None]
        )
        _, out = fold(Track(model, Arbiter(Rule(use="blend"))), [block])
        told = [r.row for r in out.records if r.evidence.get("cause") in ("frozen", "end")]
        accused += any(row < AT for row in told)
        far = np.flatnonzero(np.abs(true[AT:] - raw[AT]) > band + quantum + 6.0 * sigma)
        late = far[0] + 60 if len(far) else ROWS
        could += late < ROWS - AT
        found += late < ROWS - AT and any(AT <= row < AT + late for row in told)
    assert accused <= 2 and could >= 20 and found >= 0.9 * could, (accused, found, could)


def test_a_late_answer_is_not_frozen_once_it_was_seen() -> None:
    """A model without states is ahead of its machine by some rows, again and again."""
    accused = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, 11])
        late = int(rng.integers(4, 12))
        u = np.resize(np.repeat(rng.uniform(0.0, 10.0, 60), int(rng.integers(20, 50))), ROWS)
        true = 1.02 * np.concatenate([np.full(late, u[0]), u[:-late]])
        sigma = 10.0 ** rng.uniform(-2.0, -0.7)
        raw = true + rng.normal(0.0, sigma, ROWS)
        seen = recorded(raw, sigma * rng.uniform(3.0, 6.0), 0.1 * sigma)
        model = FunctionModel(
            lambda x, u, dt, p: ([], [u[0]]), Layout.of(u="A"), Layout.of(y="N"), Layout()
        )
        block = make_block(np.arange(ROWS) * 10**9, u[:, None], seen[:, None])
        _, out = fold(Track(model, Arbiter(Rule(use="blend"))), [block])
        told = [r.evidence["onset"] for r in out.records if r.evidence.get("cause") == "frozen"]
        accused += len(set(told))
    assert accused <= 60, accused
