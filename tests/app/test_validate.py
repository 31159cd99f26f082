"""The command ``validate``: both reports on stdout, as JSON, as a page; its exit codes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin

from .conftest import Command, columns, save


@pytest.fixture(autouse=True)
def second(folder: Path) -> Path:
    return save(folder / "held.csv", columns(seed=2))


def test_what_is_tuned_first_is_within_its_requirement(call: Command) -> None:
    raw = call("validate", "robot.toml", "--test", "held.csv", "--check")
    assert raw.code == 1 and "MISSED  x" in raw.out and "with --train it is tuned" in raw.out
    done = call("validate", "robot.toml", "--train", "robot.csv", "--test", "held.csv", "--check")
    assert done.code == 0 and "ok      x" in done.out
    assert "way is speed times time" in done.out and "not run independent engine" in done.out


def test_one_document_holds_both_reports(call: Command) -> None:
    found = call("validate", "robot.toml", "--train", "robot.csv", "--test", "held.csv", "--json")
    content = found.json
    assert content["schema"] == "evertwin.validate/1" and content["passed"] is True
    assert content["verification"]["passed"] and content["validation"]["passed"]
    output = content["validation"]["outputs"]["x"]
    assert output["limit"] == 0.005 and output["rms"] < 0.005 and output["rows"] > 1000
    assert [run["file"] for run in content["validation"]["runs"]] == ["held.csv"]


def test_a_part_of_a_recording_can_be_held_out(call: Command) -> None:
    words = ("--train", "robot.csv@:80", "--test", "robot.csv@80:", "held.csv@:20")
    found = call("validate", "robot.toml", *words, "--json").json
    files = [run["file"] for run in found["validation"]["runs"]]
    assert files == ["robot.csv@80:", "held.csv@:20"]


def test_without_a_recording_the_model_alone_is_verified(call: Command) -> None:
    found = call("validate", "robot.toml", "--json").json
    assert found["verification"]["passed"] and found["validation"]["passed"] is None
    assert "no run was given" in call("validate", "robot.toml").out


def test_the_page_holds_everything_in_one_file(call: Command, folder: Path) -> None:
    call("validate", "robot.toml", "--test", "held.csv", "--report", "page.html")
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "a circle" not in page and "way is speed times time" in page and "beyond" in page
    assert page.count("<svg") == 1 and 'class="bar' in page and "http" not in page


def test_a_recording_that_is_absent_is_told(call: Command) -> None:
    done = call("validate", "robot.toml", "--test", "gone.csv")
    assert done.code == 4 and "gone.csv: there is no such file" in done.err
    unwritable = call("validate", "robot.toml", "--report", "robot.toml/page.html")
    assert unwritable.code == 2 and "cannot be written" in unwritable.err


def test_nothing_goes_live(folder: Path) -> None:
    with Twin.open(folder / "robot.toml") as twin:
        before, told = twin.champion.number, twin.events
        found = twin.validate([str(folder / "held.csv")], [str(folder / "robot.csv")])
        assert found.passed and twin.champion.number == before and twin.events == told
        assert "independent engine" in str(found)
        held = {k: np.asarray(v) for k, v in columns(seed=3).items()}
        scaled = {"t": held["t"], "v": 0.01 * held["v"], "x": 0.01 * held["x"]}
        assert not twin.validate([scaled]).passed
