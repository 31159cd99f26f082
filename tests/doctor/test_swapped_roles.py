"""A sensor of the room among those of the box, and one of the box in its place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from evertwin import Twin
from planted.draws import first_of

DataSet = Callable[[str], Path]
TWINS = Path(__file__).parents[2] / "twins"


def heated(seed: int, folder: Path, order: tuple[str, str, str]) -> Path:
    """Two sensors in a box that is heated on and off, the third in the room, in these columns."""
    rng, n = np.random.default_rng(seed), 900
    on = np.repeat(rng.integers(0, 2, n), rng.integers(10, 80, n))[:n]
    gain, loss, lag = rng.uniform(0.02, 0.1), rng.uniform(0.002, 0.01), rng.uniform(0.05, 0.3)
    warm, behind = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        warm[k] = warm[k - 1] + gain * on[k - 1] - loss * warm[k - 1]
        behind[k] = behind[k - 1] + lag * (warm[k] - behind[k - 1])
    room = 21.0 + 0.4 * np.sin(np.arange(n) / 600.0 + rng.uniform(0, 6))
    seen = {
        "near": room + warm, "far": room + 0.85 * behind,
        "room": room + rng.uniform(0.0, 0.02) * behind,
    }  # fmt: skip
    columns = [
        np.round((seen[name] + 0.03 * rng.normal(size=n)) / 0.0625) * 0.0625 for name in order
    ]
    lines = ["time,t1,t2,t3,heater_on"]
    lines += [
        f"{3 * k},{columns[0][k]:g},{columns[1][k]:g},{columns[2][k]:g},{on[k]}" for k in range(n)
    ]
    file = folder / "box.csv"
    file.write_text("\n".join(lines) + "\n")
    return file


def exchanged(file: Path) -> list[str]:
    with Twin.open(TWINS / "incubator.toml") as twin:
        return [one.reason for one in twin.doctor(str(file)).findings if one.kind == "exchanged"]


@first_of(("seed", "place"), [(k, place) for k in range(5) for place in (1, 2)])
def test_a_sensor_of_the_room_among_those_of_the_box_is_named(
    seed: int, place: int, tmp_path: Path
) -> None:
    """The twin's room is t1, its box the mean of t2 and t3."""
    order = ("near", "room", "far") if place == 1 else ("far", "near", "room")
    (said,) = exchanged(heated(seed, tmp_path, order))
    assert said.startswith(f"t{place + 1} and t1 look exchanged: t1 answers to heater")


@first_of("seed", range(5))
def test_a_room_that_is_one_is_no_sensor_of_the_box(seed: int, tmp_path: Path) -> None:
    assert not exchanged(heated(seed, tmp_path, ("room", "near", "far")))


def test_the_real_box_of_another_year_is_told_so(data_set: DataSet) -> None:
    folder = data_set("incubator")
    (file,) = folder.glob("2023*/*.csv")
    (said,) = exchanged(file)
    assert said.startswith("t3 and t1 look exchanged")
    assert not [said for file in folder.glob("2020*/*.csv") for said in exchanged(file)]
