"""A channel that measures something else than the model's is refused before anything runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from evertwin.config import TwinSpec
from evertwin.config.spec import AnomalySpec, ChannelSpec, DeriveSpec, ModelSpec, SourceSpec
from evertwin.errors import ConfigError
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from evertwin.twin import Twin


def opened(unit: str, scale: float = 1.0, derive: tuple[DeriveSpec, ...] = ()) -> Twin:
    model = FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * u[0]]), Layout.of(v="m/s"), Layout.of(f="N"),
        Layout(), Parameters.of(c=(1.0, "Ns/m")),
    )  # fmt: skip
    channels = {"v": ChannelSpec("v", unit, scale), "f": ChannelSpec("f", "N")}
    source = SourceSpec(name="log", channels=channels)
    return Twin(TwinSpec("one", ModelSpec("python"), source=(source,), derive=derive), model)


def test_another_quantity_is_refused_with_both_units() -> None:
    with pytest.raises(ConfigError, match=r"source 'log': channel 'v' is in 'kg'.*in 'm/s'"):
        opened("kg")


@pytest.mark.parametrize("unit", ["m/s", "cm/s", "1", "km/h"])
def test_alike_units_and_pure_numbers_pass(unit: str) -> None:
    opened(unit).close()


@pytest.mark.parametrize("unit", ["1/min", "min^-1", "min-1", "Hz", "1/s"])
def test_a_rate_that_counts_turns_or_radians_is_asked(unit: str) -> None:
    spec = ModelSpec("drive_force", {"rotary": True})
    channels = {"speed": ChannelSpec("n", unit), "torque": ChannelSpec("T", "Nm")}
    source = SourceSpec(name="log", channels=channels)
    with pytest.raises(ConfigError, match=r"may count turns or radians: write 'turn"):
        Twin(TwinSpec("shaft", spec, source=(source,)))
    for said in ("rpm", "U/min", "rad/min", "turn/s"):
        channels = {**channels, "speed": ChannelSpec("n", said)}
        Twin(TwinSpec("shaft", spec, source=(SourceSpec(name="log", channels=channels),))).close()


def test_with_a_scale_the_unit_is_that_of_what_it_makes() -> None:
    opened("cm/s", scale=3.0).close()
    for scale in (3.0, -1.0):
        with pytest.raises(ConfigError, match=r"'v' is in 'A'.*write unit = 'm/s', and as scale"):
            opened("A", scale)


def test_what_is_derived_anew_may_be_recorded_in_any_unit() -> None:
    opened("m", derive=(DeriveSpec(name="v", op="derivative", source=("v",)),)).close()


def test_a_requirement_that_measures_something_else_is_refused() -> None:
    asked = AnomalySpec.prepare({"requirement": "1 V"})
    with pytest.raises(ConfigError, match=r"requirement is in 'V', and output 'x' in 'm'"):
        Twin(TwinSpec("cart", ModelSpec("robot1d"), anomaly=AnomalySpec(0.01, unit=asked["unit"])))
    base = TwinSpec("base", ModelSpec("differential"), anomaly=AnomalySpec(0.01, unit="rad"))
    with pytest.raises(ConfigError, match=r"'x' in 'm'.*outputs = \['heading'\]"):
        Twin(base)
    Twin(replace(base, anomaly=AnomalySpec(0.01, unit="rad", outputs=("heading",)))).close()


def test_a_length_asked_of_a_pose_is_asked_of_its_heading_a_metre_ahead() -> None:
    base = TwinSpec("base", ModelSpec("differential"), anomaly=AnomalySpec(0.01, unit="cm"))
    with Twin(base) as twin:
        assert twin.setup.watched.all() and twin.setup.requirement == 0.01
    both = ModelSpec("drive", {"rotary": True})
    with pytest.raises(ConfigError, match=r"'position' in 'rad'"):
        Twin(TwinSpec("shaft", both, anomaly=AnomalySpec(0.01, unit="cm")))


AXIS = """schema = 1
name = "axis"
[model]
kind = "drive_force"
[model.parameters]
mass = 37.84
[signals.force]
low = "-1 kN"
[prediction.scale]
force = "2 N"
[moving]
above = "1 cm/s"
channels = { force = "speed" }
"""


@pytest.mark.parametrize(
    ("line", "wrong", "said"),
    [
        (6, 'mass = "37.84 N"', "model.parameters.mass.value: expected a quantity in 'kg'"),
        (6, 'mass = { value = 3, unit = "V" }', "model.parameters.mass.value: .* got '3 V'"),
        (6, 'mass = { sigma = "3 s" }', "model.parameters.mass.sigma: expected a quantity in 'kg'"),
        (8, 'low = "-1 m"', r"signals.force.low: .*in 'N' or alike, got '-1 m'"),
        (10, 'force = "2 kg"', "prediction.scale.force: expected a quantity in 'N'"),
        (12, 'above = "1 cm"', "moving.above: expected a quantity in 'm/s'"),
    ],
)
def test_a_quantity_of_another_dimension_is_told_with_its_line(
    tmp_path: Path, line: int, wrong: str, said: str
) -> None:
    lines = AXIS.splitlines()
    lines[line - 1] = wrong
    file = tmp_path / "axis.toml"
    file.write_text("\n".join(lines))
    with pytest.raises(ConfigError, match=rf"axis\.toml:{line}: {said}.*correct the unit"):
        Twin(file)


def test_quantities_in_units_alike_are_taken(tmp_path: Path) -> None:
    file = tmp_path / "axis.toml"
    file.write_text(AXIS.replace("37.84", '{ value = "0.5 t", sigma = "20 lb" }'))
    with Twin(file) as twin:
        assert twin.model.parameters["mass"].value == 500.0
        assert twin.model.parameters["mass"].sigma == pytest.approx(9.0718, rel=1e-4)
