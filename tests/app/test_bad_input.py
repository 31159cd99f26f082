"""Bad input, end to end: a clear error or a marked sample, never a wrong number."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .conftest import Command, columns, save

GAIN = 0.9


def doctored(call: Command, *words: str) -> tuple[int, dict[str, list[dict[str, Any]]]]:
    """Exit code and findings by kind of ``evertwin doctor``."""
    done = call("doctor", "robot.toml", "--data", *words, "--json")
    assert "Traceback" not in done.err, done.err
    kinds: dict[str, list[dict[str, Any]]] = {}
    for finding in done.json["findings"]:
        assert set(finding) >= {"kind", "subject", "reason", "where", "step"}
        kinds.setdefault(finding["kind"], []).append(finding)
    return done.code, kinds


def gain_of(call: Command, file: str) -> float:
    done = call("fit", "robot.toml", "--train", file, "--json")
    assert done.code == 0, done.err
    return float(done.json["parameters"]["gain"]["value"])


@pytest.mark.slow
def test_sound_data_has_no_findings(call: Command) -> None:
    assert doctored(call, "robot.csv") == (0, {})


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "", "n/a", "1e300"])
def test_absurd_cells_change_no_figure(call: Command, folder: Path, word: str) -> None:
    save(folder / "clean.csv", columns())
    lines = (folder / "robot.csv").read_text().splitlines()
    for k in (200, 500, 900):
        t, v, _ = lines[k].split(",")
        lines[k] = f"{t},{v},{word}"
    (folder / "robot.csv").write_text("\n".join(lines) + "\n")
    assert gain_of(call, "robot.csv") == pytest.approx(gain_of(call, "clean.csv"), abs=0.002)
    run = call("run", "robot.toml", "--data", "robot.csv", "--json").json
    assert run["outputs"]["x"]["rms_after"] < 0.01


def test_repeated_and_backward_stamps_are_dropped_and_named(call: Command, folder: Path) -> None:
    lines = (folder / "robot.csv").read_text().splitlines()
    lines.insert(300, lines[299])
    lines.insert(600, lines[100])
    (folder / "robot.csv").write_text("\n".join(lines) + "\n")
    code, found = doctored(call, "robot.csv")
    assert code == 1
    said = " ".join(finding["reason"] for finding in found["clock"])
    assert "repeated" in said and "backward" in said
    assert gain_of(call, "robot.csv") == pytest.approx(GAIN, abs=0.005)


def test_a_clock_that_jumps_is_named(call: Command, folder: Path) -> None:
    table = columns()
    table["t"][600:] -= 30.0
    save(folder / "robot.csv", table)
    code, found = doctored(call, "robot.csv")
    assert code == 1 and "clock_set" in found["clock"][0]["reason"]
    assert gain_of(call, "robot.csv") == pytest.approx(GAIN, abs=0.005)


def test_a_pause_is_a_gap(call: Command, folder: Path) -> None:
    table = columns()
    table["t"][600:] += 300.0
    table["x"][600:] += 50.0  # pushed by hand meanwhile
    save(folder / "robot.csv", table)
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text + '[clock]\ngap = "1 s"\n')
    code, found = doctored(call, "robot.csv")
    assert code == 1 and "300" in found["gap"][0]["reason"]
    assert gain_of(call, "robot.csv") == pytest.approx(GAIN, abs=0.005)


def test_a_truncated_row_is_left_out(call: Command, folder: Path) -> None:
    text = (folder / "robot.csv").read_text()
    (folder / "robot.csv").write_text(text + "120.0,5")
    code, found = doctored(call, "robot.csv")
    assert code == 1 and "truncated" in found["missing"][0]["reason"]


def test_a_recording_that_stands_alone_is_told_its_option(call: Command) -> None:
    for words, option in (("run", "--data"), ("fit", "--train and --test")):
        done = call(words, "robot.toml", "robot.csv")
        assert done.code == 2 and f"recordings are named by {option}" in done.err


def test_a_missing_column_is_named_with_the_nearest(call: Command, folder: Path) -> None:
    text = (folder / "robot.csv").read_text()
    (folder / "robot.csv").write_text(text.replace("t,v,x", "t,v,xx", 1))
    done = call("run", "robot.toml", "--data", "robot.csv")
    assert done.code == 4 and "'x'" in done.err and "'xx'" in done.err


@pytest.mark.parametrize(
    ("column", "factor", "named"),
    [("x", 10.0, "10^-1"), ("x", 0.01, "10^2"), ("x", 25.4, "1/25.4"), ("x", -1.0, "-1"),
     ("v", 1000.0, "10^-3"), ("v", 60.0, "1/60"), ("v", 3.6, "1/3.6")],
)  # fmt: skip
def test_a_wrong_unit_or_sign_is_named(
    call: Command, folder: Path, column: str, factor: float, named: str
) -> None:
    table = columns(gain=1.02)
    table[column] = table[column] * factor
    save(folder / "robot.csv", table)
    code, found = doctored(call, "robot.csv")
    assert code == 1
    (finding,) = found["sign" if factor < 0 else "unit"]
    said = [(h["channels"], h["factor"]) for h in finding["evidence"]["hypotheses"]]
    assert ([column], named) in said


def test_a_frozen_sensor_is_marked(call: Command, folder: Path) -> None:
    table = columns()
    table["x"][500:560] = table["x"][500]
    save(folder / "robot.csv", table)
    code, found = doctored(call, "robot.csv")
    assert code == 1 and "frozen" in found
    assert gain_of(call, "robot.csv") == pytest.approx(GAIN, abs=0.01)
    events = call("run", "robot.toml", "--data", "robot.csv", "--json").json["events"]
    assert any(e["kind"] == "measurement_error" and "frozen" in e["reason"] for e in events)


def test_standstill_determines_nothing(call: Command, folder: Path) -> None:
    table = columns()
    table["v"][:] = 0.0
    table["x"] = np.random.default_rng(3).normal(0.0, 0.1, len(table["t"]))
    save(folder / "robot.csv", table)
    code, found = doctored(call, "robot.csv")
    (finding,) = found["not_identifiable"]
    assert code == 1 and finding["subject"] == "gain" and "v" in finding["step"]
    fit = call("fit", "robot.toml", "--train", "robot.csv", "--json").json["parameters"]["gain"]
    assert (fit["value"], fit["verdict"]) == (1.0, "not")
    assert fit["interval95"] is None
    run = call("run", "robot.toml", "--data", "robot.csv", "--json").json
    assert run["parameters"]["gain"]["value"] == 1.0


def test_an_unknown_key_is_named_with_line_and_nearest(call: Command, folder: Path) -> None:
    text = (folder / "robot.toml").read_text().replace("tolerance =", "tolerence =")
    (folder / "robot.toml").write_text(text)
    line = 1 + text.splitlines().index('tolerence = "3 cm"')
    done = call("doctor", "robot.toml")
    assert done.code == 2
    assert f"robot.toml:{line}:" in done.err and "'tolerance'" in done.err


def test_a_start_value_on_or_beyond_a_bound(call: Command, folder: Path) -> None:
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text + "[model.parameters.gain]\nvalue = 0.2\n")
    code, found = doctored(call, "robot.csv")
    assert code == 1 and "lower bound" in found["at_bound"][0]["reason"]
    assert gain_of(call, "robot.csv") == pytest.approx(GAIN, abs=0.005)
    (folder / "robot.toml").write_text(text + "[model.parameters.gain]\nvalue = 7.0\n")
    done = call("doctor", "robot.toml")
    assert done.code == 2 and "gain" in done.err and "bound" in done.err


ARM = """<robot name="a"><link name="base"/><link name="arm"><inertial>
<mass value="{mass}"/><inertia ixx="{ixx}" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
</inertial>{visual}</link>
<joint name="j1" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="9" velocity="2"/></joint></robot>"""


@pytest.mark.parametrize(("mass", "ixx"), [("0", "0.1"), ("-1", "0.1"), ("1", "0"), ("1", "-0.1")])
def test_impossible_inertia_is_refused(call: Command, folder: Path, mass: str, ixx: str) -> None:
    (folder / "arm.urdf").write_text(ARM.format(mass=mass, ixx=ixx, visual=""))
    (folder / "arm.toml").write_text(
        'schema = 1\nname = "arm"\n[model]\nkind = "arm"\noptions = { urdf = "arm.urdf" }\n'
    )
    done = call("doctor", "arm.toml")
    assert done.code == 5, done.err
    assert "arm" in done.err and "Traceback" not in done.err


def test_a_missing_mesh_does_not_matter(call: Command, folder: Path) -> None:
    mesh = '<visual><geometry><mesh filename="package://none/a.stl"/></geometry></visual>'
    (folder / "arm.urdf").write_text(ARM.format(mass="1", ixx="0.1", visual=mesh))
    (folder / "arm.toml").write_text(
        'schema = 1\nname = "arm"\n[model]\nkind = "arm"\noptions = { urdf = "arm.urdf" }\n'
    )
    done = call("doctor", "arm.toml", "--json")
    assert done.code in (0, 1) and done.json["rows"] == 0, done.err


def test_a_damaged_store_is_refused(call: Command, folder: Path) -> None:
    assert call("run", "robot.toml", "--data", "robot.csv").code == 0
    data = bytearray((folder / "robot.db").read_bytes())
    while (at := data.find(b"promoted")) >= 0:
        data[at : at + 8] = b"rejected"
    (folder / "robot.db").write_bytes(bytes(data))
    done = call("model", "list", "robot.toml")
    assert done.code == 4 and "hash" in done.err and "Traceback" not in done.err
    (folder / "robot.db").write_bytes(b"not a store at all" * 100)
    done = call("model", "list", "robot.toml")
    assert done.code == 4 and "Traceback" not in done.err


@pytest.mark.slow
def test_divergence_is_told(call: Command, folder: Path) -> None:
    (folder / "wild.py").write_text(
        "from evertwin.models import FunctionModel, Parameters\n"
        "from evertwin.signals import Layout\n"
        "line = Layout.of(x='m')\n"
        "def step(x, u, dt, p):\n    y = x[0] * (1 + 1e3 * p[0]) + u[0]\n    return [y], [y]\n"
        "model = FunctionModel(step, Layout.of(v='m/s'), line, line, Parameters.of(k=(1.0, '1')))\n"
    )
    text = (folder / "robot.toml").read_text()
    model = 'kind = "python"\noptions = { file = "wild.py" }'
    text = text.replace('kind = "robot1d"', model).replace('horizon = "1 s"', 'horizon = "60 s"')
    (folder / "wild.toml").write_text(text.replace("robot.db", "wild.db"))
    for words in (("run", "wild.toml", "--data", "robot.csv"),
                  ("fit", "wild.toml", "--train", "robot.csv"),
                  ("doctor", "wild.toml", "--data", "robot.csv")):  # fmt: skip
        done = call(*words, "--json")
        assert done.code in (0, 1), done.err
        assert "NaN" not in done.out and "Infinity" not in done.out


def test_rows_left_out_are_said_and_are_a_finding(call: Command, folder: Path) -> None:
    table = columns()
    n = len(table["t"])
    assert call("run", "robot.toml", "--data", "robot.csv").out.count("left out") == 0
    table["t"] = np.round(table["t"] * 1e9)
    save(folder / "robot.csv", table)
    (folder / "robot.db").unlink()
    done = call("run", "robot.toml", "--data", "robot.csv", "--check")
    assert done.code == 1 and f"of {n} rows left out" in done.out
    assert "look like ns" in done.out and "10^9 times too long" in done.out
    (folder / "robot.db").unlink()
    (lost,) = call("run", "robot.toml", "--data", "robot.csv", "--json").json["left_out"]
    assert (
        lost["rows"] == n and lost["finding"] and lost["problems"] == {"no_stamp": lost["left_out"]}
    )
    fitted = call("fit", "robot.toml", "--train", "robot.csv", "--check")
    assert fitted.code == 1 and "look like ns" in fitted.out


def test_what_cannot_be_judged_is_a_finding(call: Command, folder: Path) -> None:
    text = (folder / "robot.toml").read_text()
    lines = [one for one in text.splitlines() if not one.startswith("requirement")]
    (folder / "free.toml").write_text("\n".join(lines).replace("robot.db", "free.db"))
    done = call("run", "free.toml", "--data", "robot.csv", "--check")
    assert done.code == 1 and done.out.startswith("Nothing was judged, for no requirement is set")


@pytest.mark.parametrize("command", ["run --data", "fit --train", "doctor --data"])
def test_a_recording_that_is_given_twice_is_refused(
    call: Command, folder: Path, command: str
) -> None:
    verb, option = command.split()
    (folder / "copy.csv").write_bytes((folder / "robot.csv").read_bytes())
    for twice, said in (
        (("robot.csv", "robot.csv"), "robot.csv: given twice: its rows would count twice"),
        (("robot.csv", "copy.csv"), "copy.csv: the same content as robot.csv"),
        (("robot.csv@0:60", "robot.csv@50:90"), "and the parts overlap"),
    ):
        done = call(verb, "robot.toml", option, *twice)
        assert done.code == 2 and said in done.err
    done = call(verb, "robot.toml", option, "robot.csv@0:60", "robot.csv@60:90")
    assert done.code in (0, 1)


@pytest.mark.parametrize("verb", ["run", "fit", "init"])
def test_rows_that_run_backward_or_one_alone_are_named_first(
    call: Command, folder: Path, verb: str
) -> None:
    """And with the exit code of data, whatever a setting would ask of rows."""
    file = folder / "robot.toml"
    file.write_text(file.read_text().replace("window = 600", 'window = "60 s"'))
    head, *rows = (folder / "robot.csv").read_text().splitlines()
    (folder / "back.csv").write_text("\n".join([head, *reversed(rows)]))
    (folder / "one.csv").write_text(f"{head}\n{rows[0]}\n")
    words = {"run": ("run", "robot.toml", "--data"), "fit": ("fit", "robot.toml", "--train"),
             "init": ("init", "-o", "new.toml")}[verb]  # fmt: skip
    back, one = (call(*words, name) for name in ("back.csv", "one.csv"))
    assert (back.code, one.code) == (4, 4)
    assert "1199 of 1200 rows " in back.err.partition(":")[2][:60] and "sort the rows" in back.err
    said = "fewer than two complete rows" if verb == "init" else "one row is left to use"
    assert said in one.err and not (folder / "new.toml").exists()
