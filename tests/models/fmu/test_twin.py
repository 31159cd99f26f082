"""A whole twin around an FMU: tuned, corrected, tried in shadow, promoted; and one that crashes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.models.fmu import Fmu, fmu

from .native import build
from .test_fmu import plain


def recording(rows: int, values: dict[str, float], gain: float = 1.0) -> dict[str, Any]:
    """What a mass with other parameters does, sampled at 100 Hz with a little noise."""
    rng = np.random.default_rng(2)
    force = np.repeat(rng.uniform(-8, 8, rows // 25), 25)
    model = plain()
    p = model.parameters.with_values(values).values
    _, y = model.simulate(np.zeros(2), gain * force[:, None], np.full(rows, 0.01), p)
    noise = rng.normal(0, 1, (rows, 2)) * [1e-3, 2e-3]
    seen = np.vstack([np.zeros(2), y[:-1, :2]]) + noise
    t = np.arange(rows) * 0.01
    # the input of a row is held over the interval that ends there
    return {"t": t, "force": force, "x": seen[:, 0], "v": seen[:, 1]}


def twin_of(model: Fmu, **changes: Any) -> Twin:
    return Twin(
        TwinSpec(
            "mass", spec.ModelSpec("fmu"), beat=spec.Span(50),
            prediction=spec.PredictionSpec(horizon=0.5),
            anomaly=spec.AnomalySpec(requirement=0.02, relative=False, window=spec.Span(300)),
            **changes,
        ),
        model,
    )  # fmt: skip


def test_it_is_tuned_and_promoted_and_survives_a_crash(tmp_path: Path) -> None:
    model = fmu(build(tmp_path, bad="segfault"), outputs=["x", "v"])
    data = recording(4500, {"fc": 2.2, "fv": 0.8})
    data["force"][4200] = 1000.0  # the FMU crashes in this row, whichever version it belongs to
    with twin_of(model) as twin:
        twin.run(data)
        kinds = [event.kind for event in twin.events]
        (lost, *_) = [event for event in twin.events if event.kind == "model_failed"]
        champion = twin.parameters_of(twin.champion.number)
    assert "promoted" in kinds and "SIGSEGV" in lost.reason
    assert 4200 <= lost.row < 4250
    assert champion["fc"].value == pytest.approx(2.2, abs=0.02)
    assert champion["fv"].value == pytest.approx(0.8, abs=0.06)
    assert model.worker.alive
    model.close()


@pytest.mark.long
def test_it_is_corrected_and_promoted(tmp_path: Path) -> None:
    """The real drive loses a fifth of the force, which no parameter of the FMU can say."""
    model = fmu(build(tmp_path), outputs=["x", "v"])
    with twin_of(
        model, tuning=spec.TuningSpec(editable=("mass",)),
        correction=spec.CorrectionSpec(channels=("force",), terms=("law",)),
    ) as twin:  # fmt: skip
        twin.run(recording(6000, {"mass": 2.0}, gain=0.8))
        promoted = [event for event in twin.events if event.kind == "promoted"]
        live, champion = twin.champion, twin.parameters_of(twin.champion.number)
    assert promoted and model.faults == ()
    assert [(term.kind, term.channel) for term in live.form.terms] == [("law", "force")]
    assert champion["law.force.gain"].value == pytest.approx(0.8, abs=0.02)
    model.close()
