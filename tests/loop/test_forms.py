"""Static maps get the terms that pay, named as causes; what none explains is said to be unknown."""

from __future__ import annotations

import numpy as np

from evertwin import FitResult
from planted.rubbing import NOISE, Extra, eccentric, hanging, recording, sticking, strange
from planted.twins import opened, shipped

LADDER = ("load", "root", "stribeck", "direction", "position", "spring", "balance")


def learned(planted: dict[int, Extra]) -> FitResult:
    runs = [recording(seed, 15.0, planted) for seed in (1, 2)]
    rows = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
    rows["t"] += np.repeat([0.0, 20.0], len(runs[0]["t"]))
    law = "+".join(("tanh", *LADDER))
    names = ("Ia*", "F*", "offset*", "Ks*", "Gc*", "Gs*")
    tuning = {"ladder": LADDER, "editable": names}
    options = {**shipped("arm").model.options, "law": law}
    with opened("arm", model={"options": options}, tuning=tuning) as twin:
        return twin.fit(rows, [recording(3, 15.0, planted)])


def test_causes_are_named_and_pay_on_an_unseen_run() -> None:
    result = learned({0: sticking, 2: eccentric, 4: hanging})
    assert "stribeck" in result.laws["shoulder_pan"]
    assert result.laws["elbow"] == "tanh+position"
    assert result.laws["wrist_2"] == "tanh+balance"
    assert result.causes["wrist_2"] == "a weight hangs on it and turns with it"
    assert "(a weight hangs on it and turns with it)" in str(result)
    assert result.unknown == ""
    assert all(d.rms < 1.6 * noise for d, noise in zip(result.test, NOISE, strict=True))


def test_what_no_cause_explains_is_said_to_be_unknown() -> None:
    result = learned({3: strange})
    assert result.laws["wrist_1"] == "tanh"
    assert "tau4 is still off by" in result.unknown
    assert "the form is not known: tuned, tau4" in str(result)
    assert result.to_dict()["form"]["unknown"] == result.unknown  # type: ignore[call-overload, index]
