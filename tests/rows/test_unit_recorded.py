"""The unit that a derived channel is recorded in is that of what it is computed of."""

from __future__ import annotations

from evertwin import TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.rows.channels import unit_recorded
from evertwin.sources.spec import ChannelSpec, SourceSpec
from evertwin.sync.spec import DeriveSpec


def unit_of(*derive: DeriveSpec, b: str = "degC") -> str:
    channels = {"a": ChannelSpec("a", unit="degC"), "b": ChannelSpec("b", unit=b)}
    source = (SourceSpec("logger", channels=channels),)
    oven = TwinSpec("oven", ModelSpec("thermal"), source=source, derive=derive)
    return unit_recorded(oven, "box")


def test_a_mean_of_filtered_channels_keeps_their_unit() -> None:
    filtered = DeriveSpec(name="a", op="filter", source=("a",))
    assert unit_of(filtered, DeriveSpec(name="box", op="mean", source=("a", "b"))) == "degC"


def test_what_has_no_one_unit_has_none() -> None:
    assert not unit_of(DeriveSpec(name="box", op="mean", source=("a", "b")), b="K")
    assert not unit_of(DeriveSpec(name="box", op="derivative", source=("a",)))
