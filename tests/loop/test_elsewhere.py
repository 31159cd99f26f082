"""Models from elsewhere through a whole twin: tuned, corrected, tried in shadow and promoted.

FMUs have the same test beside their own (tests/models/fmu), Python functions in tests/models.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.models import Model
from evertwin.models.modelica import Modelica
from evertwin.models.mujoco import MuJoCo
from evertwin.models.tables.table import TableModel
from planted.draws import first_of
from planted.masses import KNOBS, MODELICA, MUJOCO

RATE = 20


def modelica(folder: Path) -> Model:
    file = folder / "Mass.mo"
    file.write_text(MODELICA)
    return Modelica(file=str(file))


def mujoco(folder: Path) -> Model:
    return MuJoCo.from_text(MUJOCO.format(step=1 / RATE), parameters=KNOBS)


KINDS = {
    "modelica": (modelica, "fc"),
    "mujoco": (mujoco, "joint.rail.frictionloss"),
}


def recording(model: Model, rows: int, values: dict[str, float], gain: float = 1.0) -> Any:
    """What the machine with other parameters does, sampled at 20 Hz with a little noise."""
    rng = np.random.default_rng(2)
    force = np.repeat(rng.uniform(-8, 8, rows // 25), 25)
    p = model.parameters.with_values(values).values
    _, y = model.simulate(model.initial(p), gain * force[:, None], np.full(rows, 1 / RATE), p)
    seen = np.vstack([np.zeros(2), y[:-1]]) + rng.normal(0, 1, (rows, 2)) * [1e-3, 2e-3]
    columns = dict(zip(model.outputs.names, seen.T, strict=True))
    return {"t": np.arange(rows) / RATE, "force": force, **columns}


def twin_of(kind: str, model: Model, **changes: Any) -> Twin:
    return Twin(
        TwinSpec(
            "mass", spec.ModelSpec(kind), beat=spec.Span(50),
            prediction=spec.PredictionSpec(horizon=0.5),
            anomaly=spec.AnomalySpec(requirement=0.02, relative=False, window=spec.Span(300)),
            **changes,
        ),
        model,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_tuned_tried_and_promoted(kind: str, tmp_path: Path) -> None:
    build, rubs = KINDS[kind]
    model = build(tmp_path)
    with twin_of(kind, model) as twin:
        result = twin.run(recording(model, 1600, {rubs: 2.2}))
        champion = twin.parameters_of(twin.champion.number)
    tuned, promoted = result.of_kind("tuned")[0].row, result.of_kind("promoted")[0].row
    assert tuned + 20 * RATE * 0.5 <= promoted  # it has been in shadow for so many segments
    assert champion[rubs].value == pytest.approx(2.2, abs=0.03)
    assert not result.of_kind("rolled_back")


@pytest.mark.slow
@first_of("kind", KINDS)
def test_it_is_corrected_and_the_correction_is_promoted(kind: str, tmp_path: Path) -> None:
    """The real drive loses a fifth of the force, which the mass alone cannot say. It is tuned as
    long as rows are too few to look for a form, which then goes on with its trial."""
    model = KINDS[kind][0](tmp_path)
    mass = tuple(name for name in model.parameters.names if "mass" in name)
    with twin_of(
        kind, model, tuning=spec.TuningSpec(editable=mass),
        correction=spec.CorrectionSpec(channels=("force",), terms=("law",)),
    ) as twin:  # fmt: skip
        result = twin.run(recording(model, 1500, {}, gain=0.8))
        live, champion = twin.champion, twin.parameters_of(twin.champion.number)
    (corrected, *_), (promoted,) = result.of_kind("corrected"), result.of_kind("promoted")
    tuned = result.of_kind("tuned")[0]
    assert corrected.row == live.row and promoted.row > tuned.row + 20 * RATE * 0.5
    assert [(term.kind, term.channel) for term in live.form.terms] == [("law", "force")]
    assert champion["law.force.gain"].value == pytest.approx(0.8, abs=0.03)
    for name in model.parameters.names:  # nothing else moved
        assert champion[name].value == model.parameters[name].value


@pytest.mark.slow
def test_a_table_of_measured_data_is_tuned_and_promoted() -> None:
    speed = np.linspace(0.0, 200.0, 9)
    pump = TableModel.of({"speed": speed}, {"flow": np.sqrt(speed)}, {"speed": "rad/s"})
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(0, 200, 1300), 5)
    flow = 0.85 * pump.look_up(u[:, None])[:, 0] + rng.normal(0, 0.05, 6500)
    with Twin(
        TwinSpec(
            "pump", spec.ModelSpec("table"), beat=spec.Span(50),
            prediction=spec.PredictionSpec(horizon=0.5),
            anomaly=spec.AnomalySpec(requirement=0.5, relative=False, window=spec.Span(300)),
        ),
        pump,
    ) as twin:  # fmt: skip
        result = twin.run({"t": np.arange(6500) / 100, "speed": u, "flow": flow})
        champion = twin.parameters_of(twin.champion.number)
    assert result.of_kind("promoted")
    assert champion["gain.flow"].value == pytest.approx(0.85, abs=0.01)
