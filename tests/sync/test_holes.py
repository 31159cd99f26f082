"""Holes of a recording on a grid that is differentiated: no slope of a straight line is learned."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config.spec import ClockSpec, FilterSpec
from planted.axes import Axis, drawn, kept
from planted.twins import opened


def axis_twin(axis: Axis, *, smooth: bool = False) -> Twin:
    rate = 1.0 / float(np.median(np.diff(axis.columns["t"])))
    rule = FilterSpec(cutoff=rate / 8.0, inputs=("position",)) if smooth else None
    moving = {"above": 0.005 * axis.top}
    return opened("emps", filter=rule, clock=ClockSpec(rate=rate), moving=moving)


def told(axis: Axis, how: str, seed: int) -> dict[str, np.ndarray]:
    stays = kept(how, len(axis.columns["t"]), seed)
    return {name: axis.columns[name][stays] for name in ("t", "position", "force")}


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("how", ["random 1 %", "random 20 %", "bursts", "gap", "random 5 %, gap"])
def test_lost_samples_hardly_move_the_numbers(how: str, smooth: bool) -> None:
    axis = drawn("plain", 2)
    found = {
        p.name: p.value for p in axis_twin(axis, smooth=smooth).fit(told(axis, how, 2)).parameters
    }
    for name in ("mass", "Fv", "Fc"):
        assert found[name] == pytest.approx(axis.truth[name], rel=0.03), name


def test_a_long_hole_starts_the_grid_anew_and_a_short_one_is_bridged() -> None:
    axis = drawn("plain", 2)
    n = len(axis.columns["t"])
    for hole, gaps in ((2, 1), (5, 2)):
        stays = np.ones(n, dtype=np.bool_)
        stays[1000 : 1000 + hole] = False
        columns = {name: axis.columns[name][stays] for name in ("t", "position", "force")}
        (block,) = axis_twin(axis).blocks(columns)
        assert int(block.gap.sum()) == gaps
        assert len(block.t) == (n if gaps == 1 else n - hole)


def test_a_source_slower_than_the_grid_has_no_hole() -> None:
    axis = drawn("plain", 2)
    few = {name: axis.columns[name][::5] for name in ("t", "position", "force")}
    (block,) = axis_twin(axis).blocks(few)
    speeds = block.mark[:, : len(axis_twin(axis).model.inputs)]
    assert int(block.gap.sum()) == 1 and int(speeds.max()) <= 2
