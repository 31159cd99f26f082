"""A first twin file asks for what noise and the pace of its rows let reach."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from planted.draws import first_of


def driven(seed: int, noise: float, rows: int = 600, step: float = 0.2) -> list[np.ndarray]:
    """A base that does what it is told, its position measured with noise."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.2, 0.3, rows), rng.integers(5, 25, rows))[:rows]
    w = np.repeat(rng.uniform(-0.2, 0.2, rows), rng.integers(5, 25, rows))[:rows]
    heading = np.cumsum(w * step)
    x, y = np.cumsum(v * np.cos(heading) * step), np.cumsum(v * np.sin(heading) * step)
    t = np.arange(rows) * step
    pose = [c + rng.normal(0.0, s, rows) for c, s in ((x, noise), (y, noise), (heading, 0.001))]
    return [t, v, w, *pose]


def told(seed: int, on_rows: bool, step: float = 0.2, fine: int = 20) -> list[np.ndarray]:
    """A base that lags 0.05 s, whose commands come with the rows, or at any time between two."""
    rng, n = np.random.default_rng(seed), 500 * fine
    last = rng.integers(60, 300, n) // fine * fine if on_rows else rng.integers(60, 300, n)
    v = np.repeat(rng.uniform(-0.4, 0.6, n), last)[:n]
    w = np.repeat(rng.uniform(-0.4, 0.4, n), last)[:n]
    speed, rest = np.zeros(n), 0.0
    for k, command in enumerate(v.tolist()):
        rest += (command - rest) * (1.0 - np.exp(-step / fine / 0.05))
        speed[k] = rest
    way = step / fine * np.array([speed, w])
    heading = np.cumsum(way[1]) - way[1]
    x, y = (np.cumsum(way[0] * f(heading)) - way[0] * f(heading) for f in (np.cos, np.sin))
    columns = [np.arange(n) * step / fine, v, w, x, y, heading]
    t, v, w, *pose = (column[::fine] for column in columns)
    return [t, v, w, *(c + rng.normal(0.0, 0.002, len(t)) for c in pose)]


def asked(folder: Path, rows: list[np.ndarray]) -> float:
    text = ["t [s],v_cmd [m/s],w_cmd [rad/s],x [m],y [m],heading [rad]"]
    text += [",".join(f"{value:.5f}" for value in row) for row in zip(*rows, strict=True)]
    (folder / "run.csv").write_text("\n".join(text) + "\n")
    write_starter([folder / "run.csv"], folder / "new.toml", ("", None), True, False)
    found = re.search(r"^requirement = (\S+)", (folder / "new.toml").read_text(), re.M)
    assert found is not None
    return float(found[1])


@first_of("seed", range(3))
@pytest.mark.parametrize("noise", [0.01, 0.02, 0.04])
def test_less_than_noise_makes_is_not_asked(
    seed: int, noise: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 1.1 * np.sqrt(2.0) * noise < asked(tmp_path, driven(seed, noise)) < 4.0 * noise


def test_without_noise_it_is_a_share_of_the_way_or_what_rows_let_tell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 0.0 < asked(tmp_path, driven(0, 1e-5)) < 0.03


@first_of("seed", range(6))
def test_commands_that_come_with_the_rows_leave_noise_alone(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert asked(tmp_path, told(seed, on_rows=True)) <= 0.02
    assert asked(tmp_path, told(seed, on_rows=False)) >= 0.03


def held(folder: Path, seed: int, alive: float) -> float:
    """Rate [Hz] that is proposed for commands which come as they change, and once every ``alive``
    seconds, beside poses at 12 Hz."""
    rng = np.random.default_rng(seed)
    changes = np.unique(np.r_[0.0, np.cumsum(rng.uniform(1.0, 5.0, 40)).round(2)])
    stamps = np.unique(np.r_[changes, np.arange(0.0, 100.0, alive)])
    at = np.searchsorted(changes, stamps, side="right") - 1
    v, w = rng.uniform(-0.3, 0.3, len(changes))[at], rng.uniform(-0.3, 0.3, len(changes))[at]
    table = [f"{t:.3f},{a:.4f},{b:.4f}" for t, a, b in zip(stamps, v, w, strict=True)]
    (folder / "command.csv").write_text("\n".join(["t [s],v_cmd [m/s],w_cmd [rad/s]", *table]))
    t = np.arange(0.0, 100.0, 1.0 / 12.0)
    pose = [f"{s:.4f},{np.sin(s / 9):.4f},{np.cos(s / 9):.4f},{s / 9:.4f}" for s in t]
    (folder / "pose.csv").write_text("\n".join(["t [s],x [m],y [m],heading [rad]", *pose]))
    files = [folder / "command.csv", folder / "pose.csv"]
    write_starter(files, folder / "new.toml", ("", None), True, False)
    rate = read(folder / "new.toml").clock.rate
    assert rate is not None
    return rate


@first_of("seed", range(3))
@pytest.mark.parametrize("alive", [0.5, 1.0, 2.0, 1000.0])
def test_commands_that_hold_do_not_set_the_rate(
    seed: int, alive: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 11.5 < held(tmp_path, seed, alive) < 12.5
