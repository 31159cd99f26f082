"""Rows that would have a mass below zero."""

from __future__ import annotations

import numpy as np

from evertwin.config.spec import ClockSpec
from planted.twins import opened


def test_terms_are_chosen_though_a_number_would_lie_where_none_is_allowed() -> None:
    rng, t = np.random.default_rng(0), np.arange(1500) * 0.01
    v, a = np.sin(t) + 0.3 * np.sin(3.1 * t), rng.normal(0.0, 5.0, 1500)
    friction = np.sign(v) * (20 + 30 * np.sqrt(np.abs(v))) + 100 * v
    force = friction - a + rng.normal(0.0, 3.0, 1500)
    twin = opened(
        "emps", model={"options": {"law": "sign+direction+root"}}, derive=(), filter=None,
        clock=ClockSpec(), moving={"above": 0.005}, tuning={"ladder": ("direction", "root")},
    )  # fmt: skip
    columns = {"t": t, "position": np.cumsum(v) * 0.01, "speed": v, "acceleration": a}
    fit = twin.fit({**columns, "force": force}).fit
    found = dict(zip(fit.names, fit.values.tolist(), strict=True))
    assert 0.0 < found["mass"] < 0.1
    told = found["Fc"] + found["Fr"] + found["Fv"]  # at 1 m/s, however they share it
    assert abs(told - 150) < 5
