"""What a correction says is the machine's: a gain that did not change is not told lower, and a dead
zone is not told as a lower gain. `python -m proofs.true_numbers` asks it of more robots."""

from __future__ import annotations

from typing import Any

import pytest

from evertwin import Twin
from planted.draws import first_of
from planted.losing import GAIN, NUMBERS, driven, plane


@pytest.mark.slow
@first_of("kind", NUMBERS)
def test_a_law_is_told_beside_the_gain_that_the_machine_has(kind: str) -> None:
    name, true = NUMBERS[kind]
    result = Twin(plane()).run(driven(0, kind))
    assert result.parameters["gain"].value == pytest.approx(GAIN, rel=0.02)
    assert result.parameters["law.v.gain"].value == 1.0
    assert result.parameters[name].value == pytest.approx(true, rel=0.05)
    assert max(result.outputs[k].rms_after for k in ("x", "y")) < 0.006
    told: Any = result.to_dict()["parameters"]
    low, high = told[name]["interval95"]
    assert low < true < high
