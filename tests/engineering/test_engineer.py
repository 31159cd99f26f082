"""From a breakdown file and a recording to a twin file that runs."""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.engineering.engineer import engineer
from evertwin.errors import ConfigError, DataError
from evertwin.prognosis.laws import Life, NotEnough
from evertwin.report.engineering_report import engineering_text
from evertwin.twin import Twin

BREAKDOWN = """schema = 1
name = "axis"
about = "a feed axis"

[requirements]
interval = "1 week"

[sensors.tau1]
measures = "motor force"

[[system]]
name = "mechanical"

[[system.component]]
name = "guide"
kind = "guide"
axis = 1
options = { friction = "tanh", width = 0.01 }
effect = 4
proneness = 4
physics = "friction laws"
sensors = ["tau1"]
wear = [{ effect = "abrasion", parameters = ["Fc", "Fv"], drift = 0.5 }]

[system.component.parameters]
Fc = { value = 10, unit = "N", low = 0, high = 200, limit = 40, source = "literature" }
Fv = { value = 0.05, unit = "Ns/m", low = 0, high = 100, source = "literature" }

[[system.component]]
name = "table"
kind = "mass"
axis = 1
effect = 2
proneness = 1
parameters = { mass = { unit = "kg", low = 0.1, high = 100, source = "experiment" } }

[[twin.source]]
name = "log"
files = ["data/*.csv"]
time = { column = "t", unit = "s" }

[twin.source.channels]
qd1 = { column = "v", unit = "m/s" }
qdd1 = { column = "a", unit = "m/s^2" }
tau1 = { column = "f", unit = "N" }

[twin.arbiter]
gate = 12.0

[twin.anomaly]
window = 200

[twin.tuning]
window = 600
"""


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer samples and tunings."""
    monkeypatch.setattr("evertwin.engineering.sensitivity.BUDGET", 100_000)
    monkeypatch.setattr("evertwin.engineering.weights.FEWEST", 6)
    monkeypatch.setattr("evertwin.engineering.weights.MOST", 6)
    monkeypatch.setattr("evertwin.engineering.weights.REPEATS", 1)


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    folder = tmp_path / "machine"
    (folder / "data").mkdir(parents=True)
    (folder / "axis.toml").write_text(BREAKDOWN)
    record(folder / "data" / "a.csv", 20.0, 1)
    return folder


def record(path: Path, friction: float, seed: int) -> Path:
    """12 s of the axis with this Coulomb friction [N]."""
    t = np.arange(600) * 0.02
    v = 0.2 * np.sin(2 * t) + 0.1 * np.sin(5 * t)
    a = np.gradient(v, t)
    noise = 0.2 * np.random.default_rng(seed).standard_normal(len(t))
    force = friction * np.tanh(v / 0.01) + 0.1 * v + 12.0 * a + noise
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "v", "a", "f"])
        writer.writerows(np.stack([t, v, a, force], axis=1).tolist())
    return path


def test_the_written_twin_runs_and_finds_the_truth(machine: Path, tmp_path: Path) -> None:
    done = engineer(machine / "axis.toml", tmp_path / "out" / "axis.toml")
    assert done.study.chosen.editable == ("guide.Fc",)
    with Twin.open(done.path) as twin:
        assert twin.spec.anomaly.requirement == 0.05
        assert twin.spec.tuning.editable == ("guide.Fc",)
        # found by a first fit, and written down
        assert twin.model.parameters["table.mass"].value == pytest.approx(12.0, rel=0.02)
        assert twin.model.parameters["table.mass"].source.startswith("experiment: first fit")
        result = twin.run()
        assert result.of_kind("tuned")
        fitted = twin.fit([str(machine / "data" / "a.csv")]).fit
    assert fitted.values[0] == pytest.approx(20.0, abs=0.2)
    content = tomllib.loads(done.text)
    assert content["source"][0]["files"] == ["../machine/data/*.csv"]
    assert content["indicator"] == [
        {"name": "guide.Fc", "component": "guide", "parameter": "guide.Fc"}
    ]
    assert "# guide.Fv: negligible" in done.text


@pytest.mark.slow
def test_lives_and_plan_of_an_engineered_twin(machine: Path, tmp_path: Path) -> None:
    """Friction grows by 1 N a run from 20 N; the breakdown says it is worn out at 40 N."""
    text = BREAKDOWN.replace('interval = "1 week"', 'interval = "10 s"')
    text = text.replace(
        "effect = 4\n", "effect = 4\ncost = { failure = 9000, maintenance = 900 }\n"
    )
    (machine / "axis.toml").write_text(text)
    done = engineer(machine / "axis.toml", tmp_path / "axis.toml")
    assert '# path = "axis.db"' in done.text
    content = tomllib.loads(done.text)
    assert content["prognosis"]["components"] == {"guide": {"failure": 9000, "maintenance": 900}}
    with Twin.open(done.path) as twin:
        lives = twin.life()
        assert "the twin file names no store" in lives.notes[0] and "note:" in str(lives)
    kept = done.text.replace("# [store]\n# path", "[store]\npath")
    done.path.write_text(kept)
    for k in range(12):
        with Twin.open(done.path) as twin:
            twin.run([str(record(tmp_path / f"{k}.csv", 20.0 + k, k))])
    with Twin.open(done.path) as twin:
        lives = twin.life()
        guide = lives.components["guide"]
        assert (
            guide.indicator.limit.value == 40.0
            and "axis.toml: guide" in guide.indicator.limit.source
        )
        assert isinstance(guide.life, Life) and not lives.notes
        # 31 N in run 12: 9 more
        assert guide.life.interval95[0] <= 9.0 <= guide.life.interval95[1]
        assert guide.life.median == pytest.approx(9.0, abs=0.5)
        (item,) = twin.plan().items
        assert item.component == "guide" and 0.0 < item.after < 9.0
        twin.maintained("guide", "guide replaced")
    with Twin.open(done.path) as twin:
        assert isinstance(twin.life().components["guide"].life, NotEnough)
        assert "guide" in twin.plan().without


def studied(machine: Path, tmp_path: Path, *changed: tuple[str, str]) -> str:
    text = BREAKDOWN
    for old, new in changed:
        assert old in text
        text = text.replace(old, new)
    (machine / "axis.toml").write_text(text)
    return engineering_text(engineer(machine / "axis.toml", tmp_path / "a.toml").study)


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        ("40", ""),
        ("15", "N, beyond its limit of health 15 N: its life is over now"),
        ("5", "N, its limit of health 5 N lies below: it wears by a fall"),
    ],
)
def test_a_limit_is_held_against_what_was_found(
    limit: str, said: str, machine: Path, tmp_path: Path
) -> None:
    told = studied(machine, tmp_path, ("limit = 40", f"limit = {limit}"))
    assert ("note: guide.Fc is" in told) == bool(said) and said in told


def test_what_is_left_is_said_where_nothing_is_tuned(machine: Path, tmp_path: Path) -> None:
    told = studied(machine, tmp_path, ("drift = 0.5", "drift = 0"))
    row = next(line for line in told.splitlines() if "nothing is tuned" in line)
    assert "off, asked 5%: NOT met; say what drifts" in row
    assert "guide.Fc is not tuned, nothing follows its limit of health 40 N" in told


def test_what_the_breakdown_decides_is_not_said_twice(machine: Path, tmp_path: Path) -> None:
    text = BREAKDOWN.replace("[twin.tuning]", '[twin.tuning]\neditable = ["*"]')
    (machine / "axis.toml").write_text(text)
    with pytest.raises(ConfigError, match=r"\[twin.tuning\] editable: say it at the component"):
        engineer(machine / "axis.toml", tmp_path / "a.toml")
    assert not (tmp_path / "a.toml").exists()


def test_a_choice_needs_recordings(machine: Path, tmp_path: Path) -> None:
    text = BREAKDOWN.replace('files = ["data/*.csv"]\n', "")
    (machine / "axis.toml").write_text(text)
    with pytest.raises(DataError, match="the choice rests on recordings"):
        engineer(machine / "axis.toml", tmp_path / "a.toml")


def command(*words: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(list(words))
    return int(end.value.code or 0)


def test_the_command_writes_twin_and_report(
    machine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twin, report = tmp_path / "a.toml", tmp_path / "a.html"
    words = ["engineer", str(machine / "axis.toml"), "-o", str(twin), "--report", str(report)]
    assert command(*words, "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["editable"] == ["guide.Fc"]
    assert content["file"] == str(twin)
    page = report.read_text(encoding="utf-8")
    for shown in ('<span class="box ', "bar crit", "bar tune", "turn due", "rgba(31, 111, 180, 0."):
        assert shown in page
    assert "http" not in page.replace("http-equiv", "")
    assert command(*words) == 2
    assert "say --force" in capsys.readouterr().err
    assert command(*words, "--force", "--data", str(machine / "data" / "a.csv")) == 0
    assert "1. components" in capsys.readouterr().out


def test_the_schema_of_the_breakdown_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert command("schema", "--breakdown") == 0
    assert json.loads(capsys.readouterr().out)["title"] == "evertwin breakdown file"
