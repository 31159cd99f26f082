"""The contract of the command line: documents, exit codes, one clear message per error."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.app.first import info_command as info
from evertwin.store import SqliteStore
from planted.draws import first_of

from .conftest import Command, columns, save

RUN = {"schema", "samples", "seconds", "outputs", "position_updates", "events", "champion",
       "parameters"}  # fmt: skip


def test_run_gives_its_document_and_nothing_else_on_stdout(spawn: Command) -> None:
    done = spawn("run", "robot.toml", "--data", "robot.csv", "--json")
    assert done.code == 0, done.err
    content = done.json
    assert content["schema"] == "evertwin.run/1" and set(content) >= RUN
    assert content["samples"] == 1200
    x = content["outputs"]["x"]
    assert x["unit"] == "m" and x["rms_after"] < 0.5 * x["rms_before"]
    assert set(x) >= {"relative_rms_before", "relative_rms_after"}
    assert content["position_updates"]["after"] <= content["position_updates"]["before"]
    gain = content["parameters"]["gain"]
    assert gain["value"] == pytest.approx(0.9, abs=0.01) and gain["verdict"] == "identifiable"
    assert gain["interval95"][0] < gain["value"] < gain["interval95"][1]
    kinds = [event["kind"] for event in content["events"]]
    assert "suspected" in kinds and "promoted" in kinds
    for event in content["events"]:
        assert set(event) >= {"time", "row", "kind", "signal", "reason", "evidence"}
    assert set(content["champion"]) >= {"version", "hash", "terms"}


@pytest.mark.slow
def test_workers_change_nothing_but_where_the_work_is_done(call: Command, folder: Path) -> None:
    run = ("run", "robot.toml", "--data", "robot.csv", "--json")
    fit = ("fit", "robot.toml", "--train", "robot.csv", "--json")
    for words in (run, fit):
        told = []
        for workers in "01":
            for file in folder.glob("robot.db*"):
                file.unlink()
            told.append(call(*words, "--workers", workers).json | {"seconds": 0})
        assert told[0] == told[1]
    refused = call(*run, "--workers", "65")
    assert refused.code == 2 and "workers: expected a number at least 0 and at most" in refused.err


def test_fit_gives_its_document(call: Command, folder: Path) -> None:
    save(folder / "other.csv", columns(seed=2))
    done = call(
        "fit", "robot.toml", "--train", "robot.csv", "--test", "other.csv", "robot.csv", "--json"
    )
    content = done.json
    assert done.code == 0 and content["schema"] == "evertwin.fit/1"
    assert set(content) >= {"parameters", "outputs", "tests", "filter", "friction_law",
                            "iterations", "evaluations", "seconds"}  # fmt: skip
    assert [Path(test["file"]).name for test in content["tests"]] == ["other.csv", "robot.csv"]
    assert set(content["outputs"]["x"]) >= {
        "relative_rms_train", "relative_rms_test", "relative_rms_test_moving", "moving",
    }  # fmt: skip
    assert content["parameters"]["gain"]["value"] == pytest.approx(0.9, abs=0.005)


@pytest.mark.parametrize(
    ("words", "schema"),
    [
        (("info", "robot.csv"), "evertwin.info/1"),
        (("info", "robot.toml"), "evertwin.twin/1"),
        (("doctor", "robot.toml", "--data", "robot.csv"), "evertwin.doctor/1"),
        (("kpi", "robot.toml", "--data", "robot.csv", "--changed", "0"), "evertwin.kpi/1"),
        (("schema",), "evertwin.schema/1"),
        (("model", "list", "robot.toml"), "evertwin.versions/1"),
        (("model", "show", "robot.toml", "0"), "evertwin.version/1"),
        (("model", "pin", "robot.toml", "0"), "evertwin.event/1"),
        (("model", "promote", "robot.toml", "0"), "evertwin.event/1"),
        (("compare", "robot.toml", "0", "0", "--data", "robot.csv"), "evertwin.compare/1"),
        (("init", "robot.csv", "-o", "new.toml", "--model", "robot1d"), "evertwin.init/1"),
    ],
)
def test_every_command_names_its_document(
    call: Command, words: tuple[str, ...], schema: str
) -> None:
    done = call(*words, "--json")
    assert done.json["schema"] == schema
    assert done.code == 0, done.err


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("run",), 2, "Missing argument"),
        (("run", "robot.toml", "--bogus"), 2, "No such option"),
        (("walk",), 2, "No such command"),
        (("compare", "robot.toml", "one", "2"), 2, "valid integer"),
        (("run", "none.toml"), 2, "none.toml: cannot be read"),
        (("run", "robot.toml"), 2, "no data"),
        (("run", "robot.toml", "--data", "none.csv"), 4, "none.csv: no such file"),
        (("info", "none.csv"), 4, "none.csv: no such file"),
        (("model", "show", "robot.toml", "7"), 2, "there are 0 to 0"),
        (("model", "rollback", "robot.toml"), 2, "no other version"),
        (("model", "promote", "robot.toml", "7"), 2, "there are 0 to 0"),
        (("model", "pin", "robot.toml", "7"), 2, "versions 0 to 0"),
        (("init", "robot.csv", "-o", "robot.toml"), 2, "exists already"),
        (("init", "robot.csv", "-o", "a.toml", "--model", "robt1d"), 2, "did you mean 'robot1d'"),
        (("init", "robot.csv", "-o", "a.toml", "--urdf", "a.urdf"), 5, "expected a readable URDF"),
        (("run", "robot.toml", "--data", "robot.csv", "--report", "."), 2, "cannot be written"),
    ],
)
def test_errors_are_one_message_and_a_code(
    call: Command, words: tuple[str, ...], code: int, said: str
) -> None:
    done = call(*words)
    assert done.code == code, done.err
    assert said in done.err and "Traceback" not in done.err
    assert done.out == ""
    assert all(line.startswith("evertwin: ") for line in done.err.splitlines())


def test_codes_reach_the_shell(spawn: Command, folder: Path) -> None:
    assert spawn("run", "none.toml").code == 2
    assert spawn("run", "robot.toml", "--data", "none.csv").code == 4
    (folder / "bad.toml").write_text('schema = 1\nname = "a"\n[model]\nkind = "arm"\n'
                                     'options = { urdf = "bad.urdf" }\n')  # fmt: skip
    (folder / "bad.urdf").write_text("<robot name='a'><link name='b'>")
    assert spawn("doctor", "bad.toml").code == 5


def test_a_bug_is_told_as_one(call: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(info, "inspect", broken)
    done = call("info", "robot.csv")
    assert done.code == 101 and "this is a bug" in done.err and "planted" in done.err


def test_an_interrupt_ends_quietly(call: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(info, "inspect", interrupted)
    done = call("info", "robot.csv")
    assert done.code == 130 and "Traceback" not in done.err


def test_check_turns_findings_into_code_1(call: Command, folder: Path) -> None:
    assert call("info", "robot.csv", "--check").code == 0
    table = columns()
    table["x"][50:60] = float("nan")
    save(folder / "holes.csv", table)
    assert call("info", "holes.csv").code == 0
    assert call("info", "holes.csv", "--check").code == 1
    table["v"][:] = 0.0
    save(folder / "still.csv", table)
    assert call("fit", "robot.toml", "--train", "still.csv").code == 0
    assert call("fit", "robot.toml", "--train", "still.csv", "--check").code == 1
    assert call("run", "robot.toml", "--data", "robot.csv", "--check").code == 0


@first_of("seed", range(4))
@pytest.mark.parametrize("step", [30.0, -50.0])
def test_check_tells_of_a_sensor_that_stands_apart(
    seed: int, step: float, call: Command, folder: Path
) -> None:
    table, rng = columns(), np.random.default_rng(seed)
    table["x"] += rng.normal(0.0, 2e-4, len(table["x"]))
    save(folder / "robot.csv", table)
    assert call("run", "robot.toml", "--data", "robot.csv", "--again", "--check").code == 0
    table["x"][len(table["x"]) // 2 + seed :] += step
    save(folder / "robot.csv", table)
    done = call("run", "robot.toml", "--data", "robot.csv", "--again", "--check")
    assert done.code == 1 and "the sensor is off since then" in done.out


def test_a_store_belongs_to_one_process(spawn: Command, folder: Path) -> None:
    store = SqliteStore(folder / "robot.db")
    done = spawn("run", "robot.toml", "--data", "robot.csv")
    looked = spawn("model", "list", "robot.toml")
    store.close()
    assert done.code == 75 and "robot.db" in done.err and "Traceback" not in done.err
    assert looked.code == 0 and "as configured" in looked.out  # looking needs no lock


@pytest.mark.slow
def test_versions_are_kept_and_switched_by_hand(call: Command) -> None:
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    listed = call("model", "list", "robot.toml", "--json").json
    assert listed["champion"] == 1 and [v["version"] for v in listed["versions"]] == [0, 1]
    shown = call("model", "show", "robot.toml", "1", "--json").json
    assert shown["parameters"]["gain"]["value"] == pytest.approx(0.9, abs=0.01)
    assert any(event["kind"] == "promoted" for event in shown["events"])
    assert call("model", "rollback", "robot.toml", "--reason", "test").code == 0
    assert call("model", "list", "robot.toml", "--json").json["champion"] == 0
    assert call("model", "promote", "robot.toml", "1").code == 0
    assert call("model", "pin", "robot.toml", "0", "--reason", "audit").code == 0
    pinned = call("model", "list", "robot.toml", "--json").json
    assert (pinned["champion"], pinned["pinned"]) == (0, True)
    again = call("run", "robot.toml", "--data", "robot.csv", "--json").json
    assert again["champion"]["version"] == 0  # a pin always wins
    repeated = call("run", "robot.toml", "--data", "robot.csv", "--json")
    assert repeated.json | {"seconds": 0} == again | {"seconds": 0}
    assert "no row is new" in repeated.err and "--again" in repeated.err
    assert "no row is new" not in call("run", "robot.toml", "--data", "robot.csv", "--again").err
    compared = call("compare", "robot.toml", "0", "1", "--data", "robot.csv", "--json").json
    first, second = (v["outputs"]["x"]["rms"] for v in compared["versions"])
    assert second < first and compared["better_share"] > 0.5
    for words in (("model", "list", "robot.toml"), ("model", "show", "robot.toml", "1"),
                  ("compare", "robot.toml", "0", "1", "--data", "robot.csv")):  # fmt: skip
        assert "tuned gain" in call(*words).out or "version 1" in call(*words).out


def test_a_twin_without_a_store_has_nothing_to_switch(call: Command, folder: Path) -> None:
    text = (folder / "robot.toml").read_text()
    (folder / "free.toml").write_text(text.replace('[store]\npath = "robot.db"\n', ""))
    done = call("model", "promote", "free.toml", "0")
    assert done.code == 2 and "[store]" in done.err


def test_help_is_quick_and_imports_little() -> None:
    code = (
        "import sys\n"
        "from evertwin.app.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'numba', 'scipy', 'matplotlib', 'pint', 'evertwin.twin'}\n"
        "sys.exit(f'imported {heavy & set(sys.modules)}' if heavy & set(sys.modules) else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "doctor" in done.stdout


def test_no_colour_is_ever_written(call: Command) -> None:
    assert "\x1b" not in call("run", "robot.toml", "--data", "robot.csv").out
    assert "\x1b" not in call("--help").out
    assert call().code == 0  # no word at all: the help
    assert call("model").code == 2


def test_verbose_logs_to_stderr(spawn: Command) -> None:
    done = spawn("-v", "run", "robot.toml", "--data", "robot.csv", "--json")
    assert done.json["samples"] == 1200
    assert "promoted" in done.err
