"""A robot on the plane whose wheels, from the middle of a recording on, lose what is slow or cap
what is fast; its twin knows the gains, which stay."""

from __future__ import annotations

import numpy as np

from evertwin import TwinSpec
from evertwin.config import spec

GAIN, TURN, ROWS, CHANGE = 0.93, 1.05, 6000, 3000
NUMBERS = {"dead zone": ("law.v.offset", -0.06), "cap": ("law.v.cap", 0.3)}
"""By what happens: the number of the law that tells it, and its value [m/s]."""


def driven(seed: int, kind: str) -> dict[str, np.ndarray]:
    """Ten rows a second."""
    rng = np.random.default_rng(seed)
    v = np.repeat(rng.uniform(-0.1, 0.5, ROWS // 20), 20)
    w = np.repeat(rng.uniform(-0.8, 0.8, ROWS // 20), 20)
    later = np.arange(ROWS) >= CHANGE
    lost = np.sign(v) * np.maximum(np.abs(v) - 0.06, 0.0)
    moved = np.where(later, lost if kind == "dead zone" else np.minimum(v, 0.3), v)
    heading = np.r_[0.0, np.cumsum(0.1 * TURN * w[:-1])]
    middle = heading + 0.05 * TURN * w
    x, y = (
        np.r_[0.0, np.cumsum(0.1 * GAIN * moved[:-1] * way(middle[:-1]))]
        for way in (np.cos, np.sin)
    )
    pose = np.stack([x, y, heading], axis=1) + rng.normal(0.0, 0.003, (ROWS, 3))
    columns = dict(zip(("x", "y", "heading"), pose.T, strict=True))
    columns["heading"] = (columns["heading"] + np.pi) % (2 * np.pi) - np.pi
    return {"t": 0.1 * np.arange(ROWS), "v": v, "w": w, **columns}


def plane() -> TwinSpec:
    """The twin beside it."""
    numbers = {"gain": spec.ParameterSpec(GAIN), "turn_gain": spec.ParameterSpec(TURN)}
    return TwinSpec(
        "robot", spec.ModelSpec("differential", parameters=numbers), beat=spec.Span(20),
        prediction=spec.PredictionSpec(horizon=1.0), arbiter=spec.ArbiterSpec(use="blend"),
        anomaly=spec.AnomalySpec(
            requirement=0.01, relative=False, outputs=("x", "y", "heading"), window=spec.Span(1000)
        ),
        tuning=spec.TuningSpec(window=spec.Span(3000)),
        correction=spec.CorrectionSpec(channels=("v", "w"), terms=("lag", "table", "law")),
    )  # fmt: skip
