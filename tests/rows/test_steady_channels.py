"""Of which recorded channels no row may leap: of places that a speed is derived of."""

from __future__ import annotations

import pytest

from evertwin.rows.alignment import Alignment
from evertwin.sync import Feed
from planted.twins import opened


@pytest.mark.parametrize(
    ("name", "steady"), [("emps", ["position"]), ("arm_live", []), ("robot", [])]
)
def test_a_place_goes_steadily_and_a_speed_need_not(name: str, steady: list[str]) -> None:
    with opened(name) as twin:
        spec, model = twin.spec, twin.setup.model
        feeds = [Feed(source.name, tuple(source.channels)) for source in spec.source]
        operations = Alignment.of(spec, model, feeds).derive.operations
    assert [one.name for one in operations if one.op == "steady"] == steady
