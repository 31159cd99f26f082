"""Friction that a fit makes negative is not called identifiable."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.machines.friction import Law
from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.signals import Layout
from evertwin.tuning import Problem, solve


@pytest.mark.parametrize(("coulomb", "verdict"), [(2.0, "identifiable"), (-2.0, "weak")])
def test_a_negative_coulomb_friction_is_doubted(coulomb: float, verdict: str) -> None:
    model = FunctionModel(
        lambda x, u, dt, p: ([], [p[0] * u[0] + p[1] * np.sign(u[0])]), Layout.of(qd="rad/s"),
        Layout.of(tau="Nm"), parameters=Parameters(
            (Parameter("Fv", 1.0, "Nms/rad", resists=True),
             Parameter("Fc", 1.0, "Nm", resists=True))
        ),
    )  # fmt: skip
    rng = np.random.default_rng(0)
    qd = rng.uniform(-2, 2, (400, 1))
    tau = 3.0 * qd + coulomb * np.sign(qd) + rng.normal(0, 0.05, qd.shape)
    fit = solve(Problem(model, (make_block(t=np.arange(400) * 10**7, u=qd, y=tau),)))
    known = dict(zip(fit.names, fit.verdict, strict=True))
    assert known == {"Fv": "identifiable", "Fc": verdict}
    if coulomb < 0:
        assert "would drive" in fit.reasons[1]


def test_simple_laws_resist_and_rich_ones_only_in_sum() -> None:
    simple = {item.name: item.resists for item in Law().parameters()}
    assert simple == {"Fv": True, "Fc": True, "offset": False}
    rich = {item.name for item in Law.parse("tanh+stribeck").parameters() if item.resists}
    assert rich == {"Fs"}
