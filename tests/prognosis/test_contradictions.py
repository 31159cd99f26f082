"""What a history cannot mean is asked back with its row; what only looks odd is believed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.errors import DataError
from evertwin.prognosis.laws.series.indicator import Direction
from evertwin.prognosis.outlook.lone_series import Series, life_of_series

GOOD = [f"2025-{1 + k // 28:02d}-{1 + k % 28:02d},{1.9 - 0.004 * k:.4f}" for k in range(60)]
COUNTED = [f"{k},{1.9 - 0.004 * k:.4f}" for k in range(60)]


def wrong(rows: list[str], place: int, row: str) -> list[str]:
    return [*rows[:place], row, *rows[place + 1 :]]


@pytest.mark.parametrize(
    ("head", "rows", "said"),
    [
        ("date", wrong(GOOD, 30, "2204-02-03,1.78"), "h.csv:32: date: expected a time like those "
         "of the other rows (2025-01-01 to 2025-03-04), got 2204-02-03"),
        ("date", wrong(GOOD, 30, "2027-02-03,1.78"), "h.csv:32: date: expected a time like"),
        ("date", wrong(GOOD, 0, "1970-01-01,1.9"), "h.csv:2: date: expected a time like"),
        ("run", wrong(COUNTED, 59, "590000,1.664"), "h.csv:61: run: expected a time like those of "
         "the other rows (0 to 58), got 590000"),
        ("run", wrong(COUNTED, 20, "20,1820"), "h.csv:22: x: expected a value of about 1.8"),
        ("run", wrong(COUNTED, 20, "20,0.00182"), "h.csv:22: x: expected a value of about 1.8"),
    ],
)  # fmt: skip
def test_a_row_that_contradicts_the_others_is_asked_back(
    tmp_path: Path, head: str, rows: list[str], said: str
) -> None:
    file = tmp_path / "h.csv"
    file.write_text(f"{head},x\n" + "\n".join(rows))
    with pytest.raises(DataError) as error:
        life_of_series(Series(file, 1.4, "below"))
    assert said in str(error.value)
    rule = spec.IndicatorSpec("x", file="h.csv", limit=1.4, direction="below")
    clock = spec.PrognosisSpec(clock="d" if head == "date" else "run")
    twin = TwinSpec("cart", spec.ModelSpec("robot1d"), indicator=(rule,), prognosis=clock,
                    folder=str(tmp_path))  # fmt: skip
    with pytest.raises(DataError, match=r"h\.csv:"):
        Twin(twin).life()


@pytest.mark.parametrize(("zeros", "direction", "limit"), [(3, "below", 1.4), (9, "above", 2.5)])
def test_a_leap_to_exactly_zero_is_asked_back(
    tmp_path: Path, zeros: int, direction: Direction, limit: float
) -> None:
    file = tmp_path / "h.csv"
    rows = [*COUNTED, *(f"{60 + k},0" for k in range(zeros))]
    file.write_text("run,x\n" + "\n".join(rows))
    with pytest.raises(DataError, match=f"h.csv:62: x: .* {zeros} that are exactly 0 since 60 run"):
        life_of_series(Series(file, limit, direction))
    rule = spec.IndicatorSpec("x", file="h.csv", limit=limit, direction=direction)
    with pytest.raises(DataError, match="exactly 0 since 60 run"):
        Twin(TwinSpec("cart", spec.ModelSpec("robot1d"), indicator=(rule,),
                      folder=str(tmp_path))).life()  # fmt: skip
    file.write_text("run,x\n" + "\n".join(rows[:62]))
    assert life_of_series(Series(file, limit, direction)).components["x"].life is not None


@pytest.mark.parametrize("direction", ["above", "below"])
def test_a_limit_on_the_wrong_side_of_a_twins_indicator_is_asked_back(
    tmp_path: Path, direction: str
) -> None:
    way = 1.0 if direction == "above" else -1.0
    rows = "\n".join(f"{k},{2.0 + way * 0.01 * k}" for k in range(40))
    (tmp_path / "h.csv").write_text(f"run,x\n{rows}\n")
    other = "below" if direction == "above" else "above"
    rule = spec.IndicatorSpec("x", file="h.csv", limit=2.0 + way, direction=other)  # type: ignore[arg-type]
    with pytest.raises(DataError, match="begins on the sound side of the limit"):
        Twin(TwinSpec("cart", spec.ModelSpec("robot1d"), indicator=(rule,),
                      folder=str(tmp_path))).life()  # fmt: skip


def test_a_noisy_health_that_begins_near_zero_is_believed(tmp_path: Path) -> None:
    for seed in range(20):
        y = 0.25 * np.random.default_rng(seed).standard_normal(300)
        y[40:45], y[45] = 0.25 + 0.01 * np.arange(5), 0.0003  # as five of many may lie together
        file = tmp_path / "h.csv"
        file.write_text("run,x\n" + "\n".join(f"{k},{x:.6f}" for k, x in enumerate(y)))
        assert life_of_series(Series(file, 3.0)).components["x"].life.onset is None


def test_what_only_looks_odd_is_believed(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    wear = [f"{k},{max(1e-5, 0.002 * k) * (1 + 0.01 * rng.normal()):.6f}" for k in range(200)]
    for name, head, rows, limit in (
        ("from zero", "run", wear, 1.0),
        ("through zero", "run", [f"{k},{0.3 - 0.0071 * k + 0.001 * rng.normal():.6f}"
                                 for k in range(60)], -1.0),
        ("paused", "date", [*(f"2025-01-{1 + k:02d},{1 + 0.01 * k}" for k in range(9)),
                            "2025-12-01,1.2"], 2.0),
        ("worn off", "run", [f"{k},{max(1.0 - 0.02 * k, 0.0):.3f}" for k in range(60)], -1.0),
        ("ahead", "date", [f"2050-01-{1 + k:02d},{1 + 0.01 * k}" for k in range(20)], 2.0),
        ("replaced", "run,maintenance",
         [*(f"{k},,{0.001 + 0.05 * k}" for k in range(15)), "15,replaced,0.0005", "16,,0.05"],
         1.0),
    ):  # fmt: skip
        file = tmp_path / f"{name}.csv"
        file.write_text(f"{head},x\n" + "\n".join(rows))
        direction: Direction = "below" if limit < 0.0 else "above"
        assert life_of_series(Series(file, limit, direction)).components["x"].life is not None


def test_a_life_between_adjustments_says_that_it_is_told_without_another(tmp_path: Path) -> None:
    file = tmp_path / "filter.csv"
    for often in (1, 3):
        cleaned = {40 * (k + 1) for k in range(often)}
        rows = [
            f"{d},{120 + 0.4 * d + 4.0 * (d - max([c for c in cleaned if c <= d], default=0)):.0f},"
            f"{'adjusted' if d in cleaned else ''}"
            for d in range(150)
        ]
        file.write_text("d,dp [Pa],maintenance\n" + "\n".join(rows))
        said = [n for n in life_of_series(Series(file, 900.0)).notes if "not adjusted again" in n]
        assert len(said) == (often >= 3)
        assert all("3 times, about every 40 d" in note for note in said)
