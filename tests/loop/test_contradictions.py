"""Inputs of a whole twin that contradict each other; a place where contacts come again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import RunResult, Twin, TwinSpec
from evertwin.fold import Mark, make_block
from evertwin.models.spec import ParameterSpec
from evertwin.setup.configured_model import model_of
from evertwin.sync.spec import SignalSpec

from .test_external import AXIS

TRUTH = {"mass": 90.0, "Fv": 200.0, "Fc": 20.0, "offset": 0.0, "Ks": 0.0}
PLACED = replace(
    AXIS, model=replace(
        AXIS.model, options={"law": "sign+spring"},
        parameters={name: ParameterSpec(value) for name, value in TRUTH.items()},
    ),
)  # fmt: skip
ROWS, AT = 6000, 3000


def lived(
    speed: float = 1.0, worn: float = 0.0, frozen: bool = False, lost: bool = False,
    spec: TwinSpec = PLACED,
) -> RunResult:  # fmt: skip
    """An axis for 60 s, in whose second half something is wrong."""
    t, rng = np.arange(ROWS) / 100.0, np.random.default_rng(2)
    x = 0.2 * np.sin(0.9 * t) + 0.1 * np.sin(0.23 * t)
    v = np.gradient(x, 0.01)
    model = model_of(PLACED)
    u = np.stack([{"speed": v, "acceleration": np.gradient(v, 0.01), "position": x}[name]
                  for name in model.inputs.names], axis=1)  # fmt: skip
    y = model.simulate(np.zeros(0), u, np.full(ROWS, 0.01), model.parameters.values)[1]
    late = np.arange(ROWS) >= AT
    y[:, 0] += late * worn * (np.abs(x - 0.1) < 0.02) * np.sign(v) + rng.normal(0.0, 0.5, ROWS)
    if frozen:
        y[AT:] = y[AT]
    u[late & lost, model.inputs.index("position")] = np.nan
    u[:, model.inputs.index("speed")] *= np.where(late, speed, 1.0)
    with Twin(spec) as twin:
        return twin.run((make_block(np.arange(ROWS) * 10**7, u, y),))


@pytest.mark.parametrize("number", [1000.0, 0.0, -1.0])
def test_a_speed_that_contradicts_its_position_is_said_first_and_not_learned(
    number: float,
) -> None:
    result = lived(speed=number)
    (error,) = result.of_kind("measurement_error")
    assert error.signal == "speed" and AT < error.row <= AT + 500
    assert result.headline.startswith("speed has been in error since row")
    assert not result.of_kind("tuned", "promoted", "external")
    marks = result.trace["mark"][AT + 100 :, 0]
    assert (marks >= Mark.CONTESTED).all()


@pytest.mark.parametrize("limit", [0.3, 1.0, 3.0])
def test_a_speed_in_degrees_is_told_where_it_is_beyond_what_is_possible(limit: float) -> None:
    """Of up to 0.2 m/s it comes as 11.5; a speed that is not known is not one of what stands."""
    possible = replace(PLACED, signals={"speed": SignalSpec(low=-limit, high=limit)})
    result = lived(speed=57.2958, spec=possible)
    (error,) = (
        one for one in result.of_kind("measurement_error")
        if one.evidence.get("cause") == "kinematics"
    )  # fmt: skip
    assert error.signal == "speed" and AT < error.row <= AT + 300
    assert len(result.of_kind("measurement_error")) <= 5  # not each time that it is beyond
    assert error.evidence["factor"] == pytest.approx(57.2958, rel=0.02)
    assert not result.of_kind("tuned", "promoted", "external")


def test_where_a_position_is_not_known_nothing_is_asked_nor_told() -> None:
    assert not {e.kind for e in lived(lost=True, worn=25.0).events} - {"not_calibrated"}


def test_a_force_that_stands_is_frozen_once_until_the_end() -> None:
    result = lived(frozen=True)
    (error,) = result.of_kind("measurement_error")
    assert error.signal == "force" and error.evidence["cause"] == "frozen"
    assert not result.of_kind("measurement_restored", "tuned", "external")
    assert result.headline.startswith("force has been in error since row")


def test_a_place_that_rubs_more_is_the_machines_own() -> None:
    result = lived(worn=25.0)
    (place,) = result.of_kind("recurring")
    low, high = place.evidence["low"], place.evidence["high"]
    assert "position" in place.reason and 0.06 < low <= high < 0.14
    assert all(e.row < place.row for e in result.of_kind("external"))
