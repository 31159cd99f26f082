"""All lives are counted from one moment, also that of an indicator which was not seen lately."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.errors import ConfigError
from evertwin.prognosis.laws import Life, NotEnough
from evertwin.report.life_pictures import draw_indicator


def cart(folder: Path, *indicators: spec.IndicatorSpec) -> Twin:
    return Twin(
        TwinSpec("cart", spec.ModelSpec("robot1d"), indicator=indicators, folder=str(folder))
    )


def series(path: Path, runs: int, slope: float, start: float, seed: int) -> Path:
    rng = np.random.default_rng(seed)
    name = path.stem
    rows = [f"{k},{start + slope * k + rng.normal(0.0, 0.002)}" for k in range(1, runs + 1)]
    path.write_text("\n".join([f"run,{name}", *rows]) + "\n")
    return path


def test_an_old_quality_figure_is_followed_up_to_now(tmp_path: Path) -> None:
    # the weld reaches its limit in run 40; it is known up to run 20, the gain up to run 30
    series(tmp_path / "weld.csv", 20, 0.025, 1.0, 1)
    series(tmp_path / "gain.csv", 30, -0.01, 1.0, 2)
    weld = spec.IndicatorSpec("weld", file="weld.csv", limit=2.0)
    gain = spec.IndicatorSpec("gain", file="gain.csv", limit=0.5, direction="below")
    lives = cart(tmp_path, weld, gain).life(drawn=True)
    assert lives.now == 30.0 and lives.to_dict()["now"] == 30.0
    found = lives.components["weld"].life
    assert isinstance(found, Life) and found.now == 30.0
    assert found.interval95[0] <= 10.0 <= found.interval95[1] and abs(found.median - 10.0) < 1.5
    assert lives.notes == ("weld: its newest value is 10 run old",)
    course = lives.components["weld"].course
    assert course is not None and course.levels[0] == pytest.approx(1.75, abs=0.01)
    alone = cart(tmp_path, weld).life()
    before = alone.components["weld"].life
    assert alone.now == 20.0 and alone.notes == ()
    assert isinstance(before, Life) and abs(before.median - 20.0) < 1.5


def test_a_limit_that_only_the_laws_have_passed_needs_a_newer_value(tmp_path: Path) -> None:
    series(tmp_path / "weld.csv", 20, 0.025, 1.0, 1)
    series(tmp_path / "gain.csv", 48, -0.01, 1.0, 2)
    weld = spec.IndicatorSpec("weld", file="weld.csv", limit=2.0)
    gain = spec.IndicatorSpec("gain", file="gain.csv", limit=0.5, direction="below")
    lives = cart(tmp_path, weld, gain).life()
    found = lives.components["weld"].life
    assert isinstance(found, NotEnough) and found.needs == "a newer value than that of 20 run"
    assert [alarm.kind for alarm in lives.alarms if alarm.component == "weld"] == []


def test_a_machine_lasts_no_longer_than_what_is_known_of_it(tmp_path: Path) -> None:
    series(tmp_path / "gain.csv", 30, -0.01, 1.0, 2)
    series(tmp_path / "weld.csv", 3, 0.025, 1.0, 1)
    weld = spec.IndicatorSpec("weld", file="weld.csv", limit=2.0)
    gain = spec.IndicatorSpec("gain", file="gain.csv", limit=0.5, direction="below")
    lives = cart(tmp_path, weld, gain).life()
    assert isinstance(lives.machine, NotEnough)
    assert lives.machine.needs == "the life of weld"
    told = next(line for line in str(lives).splitlines() if line.startswith("machine"))
    bound = re.match(
        r"machine: not enough data: needs the life of weld; the others last ([\d.]+) run", told
    )
    assert bound is not None and float(bound[1]) == pytest.approx(20.0, abs=1.5)


@pytest.mark.parametrize(
    ("rule", "says"),
    [
        (spec.IndicatorSpec("g", parameter="gainn", limit=1.0), "no 'gainn', did you mean 'gain'?"),
        (spec.IndicatorSpec("g", formula="1 - gian", limit=1.0), "formula: no 'gian', did you"),
        (spec.IndicatorSpec("g", output="y", limit=1.0), "output: no 'y', there are x"),
        (
            spec.IndicatorSpec("g", parameter="gain", reference={"room": 20.0}, limit=1.0),
            "reference: no 'room', there is no covariate",
        ),
    ],
)
def test_names_that_nothing_has_are_refused(
    tmp_path: Path, rule: spec.IndicatorSpec, says: str
) -> None:
    with pytest.raises(ConfigError, match=says.replace("?", "\\?")):
        cart(tmp_path, rule).life()


def test_a_dated_history_is_drawn_from_now(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.002, 11)
    rows = [f"2027-03-{day:02d},{1.0 + 0.05 * day + noise[day]}" for day in range(1, 11)]
    (tmp_path / "weld.csv").write_text("\n".join(["date,weld", *rows]))
    weld = spec.IndicatorSpec("weld", file="weld.csv", limit=2.0)
    twin = TwinSpec(
        "cart", spec.ModelSpec("robot1d"), indicator=(weld,), folder=str(tmp_path),
        prognosis=spec.PrognosisSpec(clock="d"),
    )  # fmt: skip
    lives = Twin(twin).life(drawn=True)
    figure = draw_indicator(lives.components["weld"])
    assert figure.axes[-1].get_xlabel() == "from now [d]"
    left, right = figure.axes[0].get_xlim()
    assert -12.0 < left <= -9.0 and 9.0 < right < 100.0
