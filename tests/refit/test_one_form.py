"""A form that was learned without some commands is off when they come: no other machine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, CorrectionSpec, ModelSpec, PredictionSpec
from evertwin.fold import make_block
from evertwin.models.form import Form, Term
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task

SPEC = TwinSpec(
    "cart", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.01, relative=False),
    correction=CorrectionSpec(channels=("v",), terms=("law",)),
)  # fmt: skip
DT, STARTS = 0.2, 0.1
KNOWN = (1.0, 0.05, 1.0, 0.0, 1e9)
"""The gain, and a dead zone that ends too early for commands that have not come before."""


def content(kind: str, gain: float) -> dict[str, Any]:
    """The answer for a cart whose newest quarter has slow commands, or another gain too."""
    rng = np.random.default_rng(0)
    fast, slow = rng.uniform(0.12, 0.2, 60), rng.uniform(0.06, 0.2, 20)
    v = np.repeat(np.r_[fast, slow], 15)
    change = np.arange(len(v)) >= 900
    speed = np.where(v > STARTS, v, 0.0) * np.where(change, gain, 1.0)
    x = DT * np.cumsum(speed) + rng.normal(0.0, 1e-3, len(v))
    stamps = np.arange(len(v)) * round(DT * 1e9)
    block = make_block(t=stamps, u=v[:, None], y=x[:, None])
    with Twin(SPEC) as twin:
        form = Form((Term("law", "v", variant="dead zone"),))
        names = twin._versions.model_of(form).parameters.names
        values = dict(zip(names, KNOWN, strict=True))
        version = twin._versions.add(form, values, parent=0, reason="learned")
        work = Work(Setup(twin.spec, twin.model), twin._versions)
        return dict(work.content(Task(kind, version, (block,), 0, held=True)))


@pytest.mark.parametrize("kind", ["fit", "correct"])
def test_slow_commands_are_no_change_of_the_machine(kind: str) -> None:
    found = content(kind, 1.0)
    assert not any(event["kind"] == "changed" for event in found["events"])
    assert "since" not in found
    values = found["candidate"]["values"]
    assert values["law.v.threshold"] == pytest.approx(STARTS, abs=0.015)  # no command between


def test_another_gain_is_one() -> None:
    found = content("fit", 0.7)
    assert any(event["kind"] == "changed" for event in found["events"])
