"""Columns that no channel takes, though they tell what the others leave: they are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from evertwin.app.cli import app
from evertwin.starter.numbers.untaken import telling


def steps(rng: np.random.Generator, n: int, low: float, high: float) -> np.ndarray:
    return np.repeat(rng.uniform(low, high, n // 40 + 1), 40)[:n]


def hoist(path: Path, seed: int, scale: float) -> None:
    """Height, rope force and the load that hangs there, at 10 rows a second."""
    rng, n = np.random.default_rng(seed), 3000
    v = np.convolve(np.tile(steps(rng, n // 2, -0.5, 0.5), 2), np.ones(8) / 8, "same")
    load = scale * np.repeat(rng.uniform(0.0, 600.0, 20), n // 20)
    force = (load + 50.0 * scale) * (9.81 + np.gradient(v, 0.1)) + rng.normal(0, 20.0 * scale, n)
    z = 5.0 + np.cumsum(v) * 0.1 + rng.normal(0.0, 0.002, n)
    rows = np.column_stack([np.arange(n) * 0.1, z, force / 1e3, load])
    head = "t [s],height [m],rope force [kN],net mass [kg]"
    np.savetxt(path, rows, "%.6g", ",", header=head, comments="")


@pytest.mark.parametrize(("seed", "scale"), [(1, 1.0), (2, 0.3), (3, 4.0)])
def test_a_load_that_is_recorded_is_named(tmp_path: Path, seed: int, scale: float) -> None:
    hoist(tmp_path / "crane.csv", seed, scale)
    out = tmp_path / "crane.toml"
    run = CliRunner().invoke(app, ["init", str(tmp_path / "crane.csv"), "-o", str(out)])
    assert run.exit_code == 0, run.output
    (said,) = [line for line in run.output.splitlines() if "of what the others leave" in line]
    assert said.startswith("  of what the others leave of rope force, net mass tells 9"), said
    assert "Fc = { value = -" not in out.read_text()  # no friction pushes


@pytest.mark.parametrize("keeps", [False, True])
def test_what_has_nothing_to_do_with_it_is_not_named(keeps: bool) -> None:
    named = 0
    for seed in range(40):
        rng, n = np.random.default_rng(seed), 3000
        u = steps(rng, n, -1.0, 1.0)
        y = u + 0.3 * u * np.abs(u) + rng.normal(0.0, 0.1, n)
        y = np.cumsum(y) * 0.1 if keeps else y + np.cumsum(rng.normal(0.0, 0.01, n))
        others = {
            "steps": steps(rng, n, 0.0, 1.0), "walk": np.cumsum(rng.normal(size=n)),
            "noise": rng.normal(size=n), "counts": np.arange(n) * rng.normal(),
        }  # fmt: skip
        named += bool(telling(y, [u], others, 10, keeps=keeps)[0])
    assert named <= 1


def test_two_neighbours_are_named_together() -> None:
    """The middle zone of three: what either of its neighbours tells alone is little."""
    rng, n = np.random.default_rng(4), 9000
    heat = [steps(rng, n, 0.0, 1.0) for _ in range(3)]
    zones = np.zeros((n, 3))
    for i in range(1, n):
        a, b, c = zones[i - 1]
        passes = 0.01 * np.array([b - a, a + c - 2 * b, b - c])
        zones[i] = zones[i - 1] + [one[i] for one in heat] - 0.005 * zones[i - 1] + passes
    zones += rng.normal(0.0, 0.1, zones.shape)
    others = {"left": zones[:, 0], "right": zones[:, 2], "other heat": heat[0]}
    names, share = telling(zones[:, 1], [heat[1]], others, 20, keeps=True)
    assert set(names[:2]) == {"left", "right"} and share > 0.9
