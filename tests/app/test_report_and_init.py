"""The report is one file with everything inside; a proposed twin file runs as it is."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app import cli
from evertwin.app.cli import main
from evertwin.config import read
from evertwin.machines import catalog
from evertwin.models import FunctionModel
from evertwin.setup import configured_model
from evertwin.twin import Twin

from .conftest import Command, columns, save

ROOT = Path(__file__).parents[2]


def test_the_report_is_one_small_file_with_its_pictures(call: Command, folder: Path) -> None:
    text = (folder / "robot.toml").read_text()
    rule = '[correction]\nchannels = ["v"]\nterms = ["table", "law"]\nquantum = "1 cm/s"\n'
    (folder / "robot.toml").write_text(text + rule)
    table = columns()
    table["v"] = np.abs(table["v"])  # set-points of one sign, capped by the drive
    drive = np.where(table["v"] < 4.0, 0.0, np.minimum(table["v"], 9.0))
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(drive))
    table["x"] = np.concatenate([[0.0], np.cumsum(0.1 * drive[:-1])]) + noise
    save(folder / "robot.csv", table)
    done = call("run", "robot.toml", "--data", "robot.csv", "--report", "out/report.html")
    assert done.code == 0, done.err
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert len(page) < 3_000_000
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)  # nothing is loaded from elsewhere
    for title in ("Translation table", "Deviation of x before", "Deviation of x after", "Run: x",
                  "Can it be trusted?", "What was found", "e-value"):  # fmt: skip
        assert title in page, title
    assert page.count("<svg") >= 4


@pytest.mark.parametrize("kind", ["robot1d", "python"])
def test_a_proposed_twin_file_runs(call: Command, folder: Path, kind: str) -> None:
    done = call("init", "robot.csv", "-o", "new.toml", "--model", kind)
    assert done.code == 0, done.err
    assert (folder / "new.toml").read_text().count("#") >= 5
    run = call("run", "new.toml", "--json")
    assert run.code == 0, run.err
    assert run.json["samples"] == 1200


def test_a_model_of_ones_own_is_driven_by_what_varies(call: Command, folder: Path) -> None:
    rows = [f"{k},3,{k % 2 == 0},{20 + k}" for k in range(50)]
    (folder / "box.csv").write_text("\n".join(["t,interval,heater,box", *rows]))
    done = call("init", "box.csv", "-o", "box.toml", "--json")
    assert done.code == 0, done.err
    assert [m["column"] for m in done.json["channels"].values()] == ["heater", "box"]
    assert done.json["unused"] == ["interval"]


def test_init_compiles_nothing_and_a_run_does(
    call: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def noted(model: FunctionModel) -> FunctionModel:
        asked.append(model)
        return model

    monkeypatch.setattr(catalog, "translated", noted)
    monkeypatch.setattr(configured_model, "translated", noted)
    done = call("init", "robot.csv", "-o", "new.toml", "--model", "python")
    assert done.code == 0 and not asked, done.err
    assert call("run", "new.toml").code == 0 and asked


def test_what_commands_take_is_read_once(
    call: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call("schema").code == 0
    monkeypatch.setattr(cli.typer.main, "get_command", None)
    assert call("schema", "--json").code == 0


def test_inputs_and_outputs_go_by_their_names(call: Command, folder: Path) -> None:
    rows = [f"{k},{k % 7},{k % 5},{k % 3},{k % 4}" for k in range(50)]
    (folder / "tank.csv").write_text("\n".join(["t,uEst,uVal,yEst,yVal", *rows]))
    done = call("init", "tank.csv", "-o", "tank.toml", "--json")
    assert [m["column"] for m in done.json["channels"].values()] == ["uEst", "yEst"]


def test_a_pump_that_switches_makes_no_series_of_wear(call: Command, folder: Path) -> None:
    on = np.arange(300) // 20 % 2
    level = 1.0 + np.convolve(on - 0.5, np.exp(-np.arange(60) / 15.0) / 15.0)[:300]
    rows = (
        f"2026-03-14 {k // 360:02}:{k // 6 % 60:02}:{k % 6 * 10:02},{'On' if x else 'Off'},{y:.4f}"
        for k, (x, y) in enumerate(zip(on, level, strict=True))
    )
    (folder / "tank.csv").write_text("\n".join(["stamp,pump,level", *rows, ""]))
    done = call("init", "tank.csv", "-o", "tank.toml", "--json")
    assert done.code == 0, done.err
    assert [m["column"] for m in done.json["channels"].values()] == ["pump", "level"]
    run = call("run", "tank.toml")
    assert run.code == 0, run.err
    assert re.search(r"  y +rms \S+( -> \S+)?   ", run.out)  # a number without a unit


def test_the_rate_is_read_or_asked_for_where_no_column_is_a_time(
    call: Command, folder: Path
) -> None:
    rows = [f"{3 + k % 2},{20 + k % 9}" for k in range(50)]
    (folder / "box.csv").write_text("\n".join(["heater,box", *rows]))
    (folder / "stated.csv").write_text("\n".join(["heater,box,Ts", *(f"{r},4" for r in rows)]))
    stated = call("init", "stated.csv", "-o", "stated.toml")
    assert stated.code == 0 and not stated.err
    assert 'rate = "0.25 Hz"' in (folder / "stated.toml").read_text()
    judged = read(folder / "stated.toml").anomaly.window.seconds
    assert judged is not None and judged <= max(200.0 / 4, 10 * 100.0)  # of 50 rows, 4 s apart
    asked = call("init", "box.csv", "-o", "box.toml")
    assert asked.code == 0 and "log: rate of the rows" in asked.out
    run = call("run", "box.toml")
    assert run.code == 2 and "time.rate" in run.err and "'?'" in run.err


def test_what_finds_no_column_is_marked_and_refused(call: Command, folder: Path) -> None:
    done = call("init", "robot.csv", "-o", "new.toml", "--model", "differential", "--json")
    assert done.code == 0 and "heading: column" in done.json["questions"]
    run = call("run", "new.toml")
    assert run.code == 2 and "channels.heading: column: a question" in run.err


def test_an_arm_gets_its_accelerations_derived(call: Command, folder: Path) -> None:
    t = np.arange(300) * 0.01
    table: dict[str, np.ndarray] = {"t": t}
    for j in range(1, 7):
        table[f"q{j}"] = 0.1 * np.sin(t + j)
        table[f"qd{j}"] = 0.1 * np.cos(t + j)
        table[f"tau{j}"] = 0.1 * np.cos(t + j)
    save(folder / "arm.csv", table)
    done = call("init", "arm.csv", "-o", "arm.toml", "--model", "arm", "--json")
    assert done.code == 0, done.err
    assert list(done.json["derived"]) == [f"qdd{j}" for j in range(1, 7)]
    assert not done.json["questions"]
    assert read(folder / "arm.toml").clock.rate == 100.0
    assert call("run", "arm.toml").code == 0


def test_a_gantry_is_read_by_the_letters_of_its_axes(call: Command, folder: Path) -> None:
    parts, parent = [], "base"
    for k, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")):
        parts.append(
            f'<link name="l{k}"><inertial><mass value="9"/><inertia ixx="1" iyy="1" izz="1" '
            f'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j{k}" type="prismatic">'
            f'<parent link="{parent}"/><child link="l{k}"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2" effort="900" velocity="2"/></joint>'
        )
        parent = f"l{k}"
    said = f'<robot name="gantry"><link name="base"/>{"".join(parts)}</robot>'
    (folder / "gantry.urdf").write_text(said)
    t = np.arange(300) * 0.01
    table: dict[str, np.ndarray] = {"t": t}
    for j, letter in enumerate("XYZ"):
        table[f"{letter}_pos_mm"] = 100.0 * np.sin(t + j)
        table[f"{letter}_vel"] = 0.1 * np.cos(t + j)
        table[f"{letter}_force_N"] = 5.0 * np.cos(t + j)
    save(folder / "log.csv", table)
    done = call(
        "init", "log.csv", "-o", "g.toml", "--model", "arm", "--urdf", "gantry.urdf", "--json"
    )
    assert done.code == 0, done.err
    assert not done.json["questions"]
    text = (folder / "g.toml").read_text()
    for j, letter in enumerate("XYZ", 1):
        assert f'tau{j} = {{ column = "{letter}_force_N", unit = "N" }}' in text
        assert f'q{j} = {{ column = "{letter}_pos_mm", unit = "mm" }}' in text
        assert f'qd{j} = {{ column = "{letter}_vel", unit = "m/s" }}' in text


def test_the_template_names_every_section_and_builds() -> None:
    path = ROOT / "twins" / "template.toml"
    text = path.read_text(encoding="utf-8")
    with Twin.open(path) as twin:
        assert twin.model.inputs.names == ("inflow",)
    for name in ("model", "source", "derive", "signals", "clock", "filter", "moving", "arbiter",
                 "prediction", "anomaly", "tuning", "correction", "trial", "store"):  # fmt: skip
        assert re.search(rf"^#? ?\[\[?{name}", text, re.MULTILINE), name


def test_a_report_replaces_reports_alone(call: Command, folder: Path) -> None:
    text = (folder / "robot.toml").read_text()
    refused = call("validate", "robot.toml", "--report", "robot.toml")
    assert refused.code == 2 and "is there and is no report" in refused.err
    assert (folder / "robot.toml").read_text() == text
    assert call("validate", "robot.toml", "--report", "page.html").code == 0
    assert call("validate", "robot.toml", "--report", "page.html").code == 0


def test_an_error_is_a_document_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, code in ((["run", "absent.toml"], 2), (["run"], 2), (["info", "absent.csv"], 4)):
        with pytest.raises(SystemExit) as ended:
            main([*words, "--json"])
        out, err = capsys.readouterr()
        said = json.loads(out)
        assert ended.value.code == said["code"] == code and said["schema"] == "evertwin.error/1"
        assert said["error"].splitlines()[0] in err
