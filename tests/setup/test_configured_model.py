"""A twin file's model: by name, by a Python file, with the file's parameters and limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from evertwin.config.read import read
from evertwin.config.spec import ModelSpec, ParameterSpec, SignalSpec, TwinSpec
from evertwin.errors import ConfigError, ModelError, UsageError
from evertwin.setup.configured_model import model_of

TEMPLATE = Path(__file__).parents[2] / "twins" / "template_model.py"


def robot(signals: dict[str, SignalSpec] | None = None, **said: Any) -> TwinSpec:
    parameters = {"gain": ParameterSpec(**said)} if said else {}
    return TwinSpec("r", ModelSpec("robot1d", parameters=parameters), signals=signals or {})


def python(file: Path, name: str = "model") -> TwinSpec:
    return TwinSpec("r", ModelSpec("python", {"file": str(file), "name": name}))


def test_the_file_says_what_differs() -> None:
    item = model_of(robot(value=0.8, low=0.5, high=0.9, sigma=0.1, editable=False)).parameters[
        "gain"
    ]
    assert (item.name, item.value, item.low, item.high) == ("gain", 0.8, 0.5, 0.9)
    assert item.sigma == 0.1 and not item.editable
    limited = model_of(robot({"v": SignalSpec(low=-1.0, high=1.0)})).inputs.channels[0]
    assert (limited.low, limited.high) == (-1.0, 1.0)


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        (robot(value=0.1, low=0.5), "gain"),
        (robot(value=-1e9), "gain: start value -1e\\+09 is below its bound"),
        (robot(value=1e9), "gain: start value 1e\\+09 is above its bound"),
        (robot({"speed": SignalSpec()}), "speed"),
        (TwinSpec("r", ModelSpec("robot1d", parameters={"gian": ParameterSpec(1.0)})), "gian"),
        (TwinSpec("r", ModelSpec("robto1d")), "robot1d"),
    ],
)
def test_what_cannot_be_is_refused_by_name(spec: TwinSpec, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        model_of(spec)


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ('[model]\nkind = "termal"', 3, "did you mean 'thermal'"),
        (
            '[model]\nkind = "drive"\n[model.parameters]\nFc1 = { value = 1 }',
            6,
            "did you mean 'Fc'",
        ),
        ('[model]\nkind = "drive"\n[model.parameters]\nFc = { unit = "kg" }', 6, "a unit alone"),
        ('[model]\nkind = "drive"\n[signals.forc]\nlow = 0', 5, "did you mean 'force'"),
    ],
)
def test_what_the_model_refuses_is_said_with_its_line(
    text: str, line: int, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.toml"
    file.write_text(f'schema = 1\nname = "a"\n{text}\n')
    with pytest.raises(ConfigError, match=rf"a\.toml:{line}: .*{said}"):
        model_of(read(file))


def test_a_model_in_a_python_file() -> None:
    model = model_of(python(TEMPLATE))
    assert model.outputs.names == ("level",) and model.parameters.names == ("area", "outflow")


def test_a_python_file_that_is_not_there_or_holds_no_model(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no Python file 'tank\.py' beside the twin file"):
        model_of(python(tmp_path / "tank.py"))
    with pytest.raises(ConfigError, match="expected a model called 'tank'; there are model"):
        model_of(python(TEMPLATE, "tank"))


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("x = (", r"own\.py:1: SyntaxError"),
        (TEMPLATE.read_text() + "\nx = [][3]\n", r"own\.py:\d+: IndexError"),
        (TEMPLATE.read_text().replace("p[1]", "p[7]"), r"own\.py:\d+: IndexError"),
    ],
)
def test_code_that_fails_is_a_model_that_cannot_be_built(
    tmp_path: Path, code: str, said: str
) -> None:
    (tmp_path / "own.py").write_text(code)
    with pytest.raises(ModelError, match=said) as told:
        model_of(python(tmp_path / "own.py"))
    assert told.value.exit_code == 5
