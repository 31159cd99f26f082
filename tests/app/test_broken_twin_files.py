"""A twin file with a beginner's mistake ends in one line: what is wrong, where, what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import Command

OWN = 'kind = "python"\noptions = { file = "own.py", name = "model" }'
STEP = """from evertwin.models import FunctionModel
from evertwin.signals import Layout
def step(x, u, dt, p):
    return [x[0] + dt * u[0]], [x[0] + dt * u[0]]
model = FunctionModel(step, Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"))
"""


@pytest.mark.parametrize("command", ["doctor", "run"])
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('column = "v"', 'column = "w"', "robot.csv: no column 'w'"),
        ('unit = "cm" }', 'unit = "parsnip" }', "'parsnip' is not known"),
        ('"0.5 cm"', "0,5", "robot.toml:24: a decimal comma: write a point"),
        ('"0.5 cm"', '"0,5 cm"', "expected a decimal point, got a comma in '0,5 cm'"),
        ("requirement", "requirment", "did you mean 'requirement'?"),
        ("[tuning]", "[anomaly]", "robot.toml:27: section 'anomaly' stands twice"),
        ('"robot1d"', '"robot1"', "did you mean 'robot1d'?"),
        ('"0.5 cm"', '"5 kg"', "requirement is in 'kg'"),
        ('name = "log"', 'name = "log"\nfiles = ["no.csv"]', "no such file: correct robot.toml:"),
    ],
)
def test_a_mistake_in_the_file(
    call: Command, folder: Path, command: str, old: str, new: str, said: str
) -> None:
    text = (folder / "robot.toml").read_text()
    assert old in text
    (folder / "robot.toml").write_text(text.replace(old, new, 1))
    given = () if "no.csv" in new else ("--data", "robot.csv")
    done = call(command, "robot.toml", *given)
    assert done.code in (2, 4) and said in done.err and done.err.count("\n") == 1, done.err


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("", "", ""),
        ("from evertwin.models", "import numpyy\nfrom evertwin.models", "own.py:1: ModuleNotFound"),
        ("def step(x, u, dt, p)", "def step(x, u dt, p)", "own.py:3: SyntaxError"),
        ("def step(x, u, dt, p)", "def step(x, u)", "own.py: TypeError: step() takes 2"),
        ('v="m/s"', 'v="parsnip"', "own.py:5: UsageError: unit: 'parsnip' is not known"),
        ("model =", "twin =", "expected a model called 'model'; there are twin"),
    ],
)
def test_a_mistake_in_the_model_file(
    call: Command, folder: Path, old: str, new: str, said: str
) -> None:
    text = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.replace('kind = "robot1d"', OWN))
    (folder / "own.py").write_text(STEP.replace(old, new, 1))
    done = call("run", "robot.toml", "--data", "robot.csv")
    if not said:
        assert done.code == 0, done.err
        return
    code = 2 if "UsageError" in said or "expected" in said else 5  # its own code fails
    assert done.code == code and said in done.err and done.err.count("\n") == 1, done.err
