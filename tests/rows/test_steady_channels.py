"""Of which recorded channels no row may leap: of places that a speed is derived of."""

from __future__ import annotations

import pytest

from evertwin.rows.alignment import Alignment
from evertwin.sync import Feed
from planted.twins import opened

AXES = [f"q{axis}" for axis in range(1, 7)]


@pytest.mark.parametrize(
    ("name", "steady", "unit"),
    [("emps", ["position"], []), ("arm_live", [], AXES), ("robot", [], [])],
)
def test_a_place_goes_steadily_and_a_speed_need_not(
    name: str, steady: list[str], unit: list[str]
) -> None:
    """A place that a static map reads beside its speed is asked for its unit alone."""
    with opened(name) as twin:
        spec, model = twin.spec, twin.setup.model
        feeds = [Feed(source.name, tuple(source.channels)) for source in spec.source]
        operations = Alignment.of(spec, model, feeds).derive.operations
    goes = {one.name: one.value for one in operations if one.op == "steady"}
    assert goes == dict.fromkeys(steady, 1.0) | dict.fromkeys(unit, 0.0)
