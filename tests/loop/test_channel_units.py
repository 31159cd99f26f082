"""A channel that measures something else than the model's is refused before anything runs."""

from __future__ import annotations

from dataclasses import replace

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


def test_what_is_scaled_or_derived_anew_may_be_written_in_any_unit() -> None:
    opened("A", scale=3.0).close()
    opened("m", derive=(DeriveSpec(name="v", op="derivative", source=("v",)),)).close()


def test_a_requirement_that_measures_something_else_is_refused() -> None:
    asked = AnomalySpec.prepare({"requirement": "1 V"})
    with pytest.raises(ConfigError, match=r"requirement is in 'V', and output 'x' in 'm'"):
        Twin(TwinSpec("cart", ModelSpec("robot1d"), anomaly=AnomalySpec(0.01, unit=asked["unit"])))
    base = TwinSpec("base", ModelSpec("differential"), anomaly=AnomalySpec(0.01, unit="cm"))
    with pytest.raises(ConfigError, match=r"'heading' in 'rad'.*outputs = \['x', 'y'\]"):
        Twin(base)
    Twin(replace(base, anomaly=AnomalySpec(0.01, unit="cm", outputs=("x", "y")))).close()
