"""What few rows told after a change, told anew by many."""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Parameters, Twin
from evertwin.config.spec import AnomalySpec, ModelSpec, TwinSpec
from evertwin.fold import make_block
from evertwin.refit.work import Work
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task

ROWS = 1500
DRY, VISCOUS = 55.7, 156.0
SPEC = TwinSpec("axis", ModelSpec("python"), anomaly=AnomalySpec(0.12))


def answer(seed: int, **live: float) -> dict[str, Any]:
    """Of a machine that changed in both kinds of friction, whose live version has these."""
    axis = FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * np.sign(u[0]) + p[1] * u[0]]),
        Layout.of(speed="m/s"), Layout.of(force="N"),
        parameters=Parameters.of(Fc=(44.6, "N"), Fv=(124.6, "N*s/m")),
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    speed = rng.choice([-1.0, 1.0], ROWS) * rng.choice([0.1, 0.2, 0.3, 0.4], ROWS)
    force = DRY * np.sign(speed) + VISCOUS * speed + rng.normal(0.0, 3.0, ROWS)
    rows = make_block(t=np.arange(ROWS) * 10**8, u=speed[:, None], y=force[:, None])
    with Twin(SPEC, axis) as twin:
        form = twin.champion.form
        version = twin._versions.add(form, live, parent=0, reason="tuned Fc")
        work = Work(Setup(twin.spec, twin.model), twin._versions)
        task = Task("retell", version, (rows,), 1, True, commissioned=True, replaced=twin.champion)
        return work.content(task)


def test_another_split_is_told_within_the_requirement() -> None:
    for seed in range(5):
        content = answer(seed, Fc=62.9)
        values = content["candidate"]["values"]
        assert abs(values["Fc"] / DRY - 1.0) < 0.03 and abs(values["Fv"] / VISCOUS - 1.0) < 0.03
        assert "told anew by 1500 rows" in content["candidate"]["reason"]
        for name, true in (("Fc", DRY), ("Fv", VISCOUS)):
            assert content["fit"]["parameters"][name]["interval95"][0] < 1.01 * true


def test_of_numbers_that_hold_nothing_is_said() -> None:
    for seed in range(5):
        assert not any(answer(seed, Fc=DRY, Fv=VISCOUS).values())
