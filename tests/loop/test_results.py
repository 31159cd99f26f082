"""Results turn into tables, labelled arrays, pictures and text; all show the same figures."""

from __future__ import annotations

import html
import json
import logging
import math
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from evertwin.config import read
from evertwin.config.spec import (
    AnomalySpec,
    ArbiterSpec,
    ModelSpec,
    MovingSpec,
    PredictionSpec,
    Span,
    StoreSpec,
    TuningSpec,
    TwinSpec,
)
from evertwin.errors import MissingExtra, UsageError
from evertwin.fold import make_block
from evertwin.models.form import Form
from evertwin.outcome.result import RunResult
from evertwin.refit.recordings.fitting import FitResult
from evertwin.report import draw_run
from evertwin.report.run_pictures import draw_improvement
from evertwin.report.run_report import write_report
from evertwin.twin import Twin
from planted.serving import TWINS


def spec(folder: str = ".", path: str | None = None) -> TwinSpec:
    return TwinSpec(
        "robot <1>", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
        arbiter=ArbiterSpec(use="tolerance", tolerance=0.03), beat=Span(10),
        anomaly=AnomalySpec(requirement=0.005, relative=False, window=Span(100)),
        tuning=TuningSpec(window=Span(600)), store=StoreSpec(path), folder=folder,
    )  # fmt: skip


def drive(rows: int = 1200, gain: float = 0.9, seed: int = 1) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(rows)
    v = 0.1 * np.sign(np.sin(0.4 * t)) + 0.05 * np.sin(1.3 * t)
    x = np.concatenate([[0.0], np.cumsum(0.1 * gain * v[:-1])])
    return {"t": t, "v": v, "x": x + rng.normal(0.0, 0.001, rows)}


@pytest.fixture(scope="module")
def twin() -> Iterator[Twin]:
    with Twin(spec()) as twin:
        yield twin


@pytest.fixture(scope="module")
def result(twin: Twin) -> RunResult:
    return twin.run(drive())


@pytest.fixture(scope="module")
def fitted() -> FitResult:
    return Twin(spec()).fit(drive(), [drive(seed=2), drive(seed=3)])


def test_a_run_as_a_table(result: RunResult) -> None:
    table = result.to_pandas()
    assert list(table.columns) == ["t", "x.measured", "x.predicted", "x.residual"]
    assert len(table) == 1200 and table.index.name == "row"
    assert table["t"].iloc[-1] == pytest.approx(119.9)
    known = table.dropna()
    assert len(known) > 1000
    assert np.allclose(known["x.measured"] - known["x.predicted"], known["x.residual"])


def test_a_run_as_labelled_arrays_holds_the_same_rows(result: RunResult) -> None:
    data, table = result.to_xarray(), result.to_pandas()
    assert dict(data.sizes) == {"row": 1200, "output": 1}
    assert data["unit"].values.tolist() == ["m"]
    for kind in ("measured", "predicted", "residual"):
        column = data[kind].sel(output="x").values
        assert np.array_equal(column, table[f"x.{kind}"].to_numpy(), equal_nan=True)


@pytest.mark.parametrize(("package", "verb"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_what_is_not_installed_is_named(
    result: RunResult, monkeypatch: pytest.MonkeyPatch, package: str, verb: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtra, match=r"evertwin\[analysis\]"):
        getattr(result, verb)()


def test_a_run_as_plain_content(result: RunResult) -> None:
    content: Any = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert content["schema"] == "evertwin.run/1"
    gain = content["parameters"]["gain"]
    assert gain["value"] == pytest.approx(0.9, abs=0.01)
    assert gain["interval95"][0] < gain["value"] < gain["interval95"][1]
    assert content["champion"]["hash"] == result.champion.hash
    assert result.model_of(result.champion).outputs.names == ("x",)


def test_a_run_draws_and_shows_itself(result: RunResult) -> None:
    figure = draw_run(result, "x")
    assert len(figure.axes) >= 2
    plt.close(figure)
    shown = result._repr_html_()
    assert "robot &lt;1&gt;: version" in shown and "promoted" in shown
    assert shown.index(html.escape(result.headline)) < shown.index("<svg") < shown.index("<table>")
    assert "position updates" in str(result)
    with pytest.raises(UsageError):
        draw_run(result, "y")


def test_each_object_is_one_useful_line(result: RunResult) -> None:
    arm = read(TWINS / "arm_live.toml")
    with Twin(arm) as twin:
        told = [twin, arm, twin.model, twin.model.inputs, twin.model.parameters, twin.champion]
    told += [result, result.model, result.parameters, result.champion, result.events[0],
             result.outputs["x"], result.model.outputs,
             make_block(t=[0], u=[[0.0]], y=[[1.0]])]  # fmt: skip
    for one in map(repr, told):
        assert one.startswith("<") and "\n" not in one and len(one) < 300, one
    assert "off by" in repr(result.outputs["x"]) and result.headline[:60] in repr(result)
    assert repr(result.model.outputs) == "<Layout: x [m]>"
    assert "gain=0.8" in repr(result.parameters)


def test_the_first_picture_shows_a_typical_stretch_and_angles_the_short_way() -> None:
    t = 0.1 * np.arange(1200)
    w = 0.5 * np.ones(1200)
    heading = np.mod(0.5 * t * 1.02 + np.pi, 2 * np.pi) - np.pi  # as a compass has it
    still = np.zeros(1200)
    turning = TwinSpec("base", ModelSpec("differential"), prediction=PredictionSpec(horizon=1.0))
    with Twin(turning) as base:
        found = base.run({"t": t, "v": still, "w": w, "x": still, "y": still, "heading": heading})
    figure = draw_improvement(found, {}, rows=100)
    assert figure is not None
    below = figure.axes[1]
    assert below.get_ylabel() == "off by [°]"
    off = np.asarray(below.get_lines()[0].get_ydata())
    assert len(off) == 10 and 0.5 < np.abs(off).max() < 0.65


def test_the_first_picture_leaves_out_what_stands() -> None:
    t = 0.1 * np.arange(1200)
    v = np.where(np.sin(t) > 0.5, 0.2, 0.0)
    stands = TwinSpec(
        "axis", ModelSpec("robot1d"), moving=MovingSpec(above=0.01, channels={"x": "v"})
    )
    with Twin(stands) as axis:
        found = axis.run({"t": t, "v": v, "x": np.cumsum(0.02 * v)})
    figure = draw_improvement(found, {}, rows=1200)
    assert figure is not None
    moving = found.trace["moving"][:, 0]
    shown = np.isfinite(np.asarray(figure.axes[1].get_lines()[0].get_ydata()))
    assert figure.axes[0].get_xlim() == figure.axes[1].get_xlim()
    assert 300 < moving.sum() < 500 and np.array_equal(shown, moving[-len(shown) :])


def test_two_versions_are_compared(twin: Twin, result: RunResult) -> None:
    other = drive(seed=4)
    found = twin.compare(0, result.champion.number, other)
    first, second = (d[0] for d in found.deviations)
    assert second.rms < 0.5 * first.rms and found.better > 0.6
    content: Any = found.to_dict()
    assert [v["version"] for v in content["versions"]] == [0, result.champion.number]
    assert "is nearer at" in str(found)
    same = twin.compare(0, 0, other)
    assert same.better == 0.0 and same.deviations[0] == same.deviations[1]


def test_a_fit_as_plain_content(fitted: FitResult) -> None:
    content: Any = json.loads(json.dumps(fitted.to_dict(), allow_nan=False))
    assert content["schema"] == "evertwin.fit/1" and len(content["tests"]) == 2
    gain = content["parameters"]["gain"]
    assert gain["verdict"] == "identifiable"
    assert gain["interval95"][0] < 0.9 < gain["interval95"][1]
    x = content["outputs"]["x"]
    each = [t["outputs"]["x"] for t in content["tests"]]
    # the deviation over all tests together, from each alone
    rms = math.sqrt(
        sum(t["rms"] ** 2 * t["samples"] for t in each) / sum(t["samples"] for t in each)
    )
    assert x["rms_test"] == pytest.approx(rms)
    assert x["rms_test"] < 0.0025
    assert "all tests" in str(fitted) and "<pre>" in fitted._repr_html_()


def test_without_tests_there_are_no_test_figures() -> None:
    content: Any = json.loads(json.dumps(Twin(spec()).fit(drive()).to_dict()))
    x = content["outputs"]["x"]
    assert content["tests"] == [] and x["rms_test"] is None and x["moving"] > 0


def test_the_operators_hand_outlives_the_process(tmp_path: Path) -> None:
    kept = spec(str(tmp_path), "robot.db")
    with Twin(kept) as first:
        first.run(drive())
        best = first.champion.number
        assert best > 0
        first.promote(0, "to see")
        assert first.champion.number == 0
        back = first.rollback("seen")
        assert back.evidence["version"] == best
        assert back.reason.endswith(f"rolled back to version {best}: seen")
        first.pin(0)
    with Twin(kept) as second:
        assert second.pinned and second.champion.number == 0
        assert [e.kind for e in second.events][-3:] == ["promoted", "rolled_back", "pinned"]
        assert len(second.versions) > best
        assert second.parameters_of(best)["gain"].value == pytest.approx(0.9, abs=0.01)
        again = second.run(drive(seed=5))
        assert again.champion.number == 0 and not again.of_kind("promoted")
        with pytest.raises(UsageError, match="version 0 is pinned and stays live"):
            second.promote(best)
        with pytest.raises(UsageError, match="pinned"):
            second.rollback()
        second.pin(None)
        assert not second.pinned
        with pytest.raises(UsageError, match="no version is pinned"):
            second.pin(None)
        with pytest.raises(UsageError, match="there are versions 0 to"):
            second.pin(99)
        with pytest.raises(UsageError, match="version: there are 0 to"):
            second.promote(99)


def test_nothing_is_there_to_roll_back_to() -> None:
    with Twin(spec()) as fresh, pytest.raises(UsageError, match="no other version has been live"):
        fresh.rollback()


def test_a_pinned_version_is_said_to_be_pinned() -> None:
    with Twin(spec()) as twin:
        free = twin.run(drive(200, gain=1.0))
        twin.pin(0, "acceptance")
        result = twin.run(drive(200, gain=1.0, seed=2))
        twin.push(drive(200, gain=1.0, seed=3))
        assert "Version 0 is pinned" in twin.going().outcome[0]
    assert "pinned" not in str(free) and not free.to_dict()["champion"]["pinned"]
    assert result.headline.endswith("Version 0 is pinned: nothing else is tuned or goes live until "
                                    "it is unpinned.")  # fmt: skip
    assert "version 0 is live, pinned (as configured)" in str(result)
    assert result.to_dict()["champion"]["pinned"]


def test_a_second_roll_back_goes_further_back_or_says_that_it_cannot() -> None:
    with Twin(spec()) as twin:
        for gain in (0.9, 0.8):
            number = twin._ledger.keep(Form(), {"gain": gain}, "by hand").number
            twin.promote(number)
        assert [twin.rollback().evidence["version"] for _ in range(2)] == [1, 0]
        with pytest.raises(UsageError, match="no other version has been live before 0"):
            twin.rollback()
        twin.promote(2)
        assert twin.rollback().evidence["version"] == 0


def test_the_library_is_silent_until_it_is_asked(caplog: pytest.LogCaptureFixture) -> None:
    script = (
        "import logging, evertwin; log = logging.getLogger('evertwin');"
        "log.warning('nobody asked'); log.error('nobody asked')"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    with caplog.at_level(logging.INFO, logger="evertwin"):
        Twin(spec()).run(drive())
    told = [record.getMessage() for record in caplog.records if record.name == "evertwin"]
    assert any("promoted" in line for line in told)
    assert any("1200 rows in" in line for line in told)


def test_a_trial_that_is_still_open_stands_in_result_and_report(tmp_path: Path) -> None:
    whole = Twin(spec()).run(drive())
    live = whole.of_kind("promoted")[0]
    assert whole.trial is None and "on trial" not in str(whole)
    tried = whole.versions[live.evidence["version"]]
    rows = tried.row + 3 * (live.row - tried.row) // 4
    with Twin(spec()) as twin:
        result = twin.run({k: v[:rows] for k, v in drive().items()})
        write_report(result, twin.setup, tmp_path / "run.html")
    trial = result.trial
    assert trial is not None and not result.of_kind("promoted")
    assert (trial.version, trial.since, trial.reason) == (tried.number, tried.row, tried.reason)
    assert trial.gain > 0.05 and 0 < trial.segments < live.evidence["segments"]
    assert [check.name for check in trial.missing] and "safety" not in str(trial)
    assert trial.seconds is not None
    assert rows * 0.1 + trial.seconds == pytest.approx(0.1 * live.row, rel=0.3)
    content: Any = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert content["trial"]["version"] == trial.version
    assert [c["name"] for c in content["trial"]["missing"]] == [c.name for c in trial.missing]
    assert f"version {trial.version} (" in str(result) and "on trial" in result._repr_html_()
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "Not decided yet." in page and f"on trial since row {trial.since}" in page
    assert "No challenger was tried" not in page
