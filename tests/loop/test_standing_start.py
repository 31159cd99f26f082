"""A machine that stands when a run begins is judged by how large its outputs were when its twin was
fitted, not by noise over noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, PredictionSpec, Span
from evertwin.models import Parameters
from evertwin.models.form import Version
from evertwin.store.spec import StoreSpec
from planted.draws import first_of

NOISE = 0.003


def recorded(seed: int, rest: int, gain: float = 1.0) -> dict[str, np.ndarray]:
    """A flow and a temperature by a command, in units of any size, which begin at rest."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-3.0, 3.0)
    u = np.concatenate([np.zeros(rest), np.repeat(rng.uniform(0.4, 1.0, 40), 20)])
    noise = NOISE * rng.normal(size=(2, len(u)))
    flow, warm = size * (gain * u + noise[0]), 290.0 + 20.0 * (u + noise[1])
    return {"t": 0.1 * np.arange(len(u)), "u": u, "flow": flow, "warm": warm}


def pumped(x: Any, u: Any, dt: float, p: Any) -> Any:
    return x, [p[0] * u[0], 290.0 + p[1] * u[0]]


def twin(seed: int, path: Path) -> Twin:
    size = 10.0 ** np.random.default_rng(seed).uniform(-3.0, 3.0)
    model = FunctionModel(
        pumped, Layout.of(u="1"),
        Layout.of(flow="m^3/s", warm="K"),
        parameters=Parameters.of(gain=(0.7 * size, "m^3/s"), heat=(15.0, "K")),
    )  # fmt: skip
    spec = TwinSpec(
        "pump", ModelSpec("given"), anomaly=AnomalySpec(requirement=0.03, window=Span(100)),
        prediction=PredictionSpec(horizon=1.0), beat=Span(20), store=StoreSpec(str(path)),
    )  # fmt: skip
    return Twin(spec, model)


@first_of("seed", [1, 2, 3])
def test_noise_of_what_stands_is_no_deviation(seed: int, tmp_path: Path) -> None:
    with twin(seed, tmp_path / "pump.db") as new:
        new.promote(new.keep(new.fit(recorded(seed, 0))).number)
    with twin(seed, tmp_path / "pump.db") as again:  # as another process finds it
        result = again.run(recorded(seed, 400))
    doubts = result.of_kind("suspected", "abnormal", "not_identifiable", "promoted")
    assert not doubts, [e.reason for e in doubts]
    assert result.headline.startswith("The twin fits its machine, and nothing was changed")


@first_of("seed", [1, 2])
def test_what_moves_otherwise_behind_a_rest_is_told(seed: int, tmp_path: Path) -> None:
    with twin(seed, tmp_path / "pump.db") as new:
        new.promote(new.keep(new.fit(recorded(seed, 0))).number)
        result = new.run(recorded(seed, 400, gain=1.1))
    (told, *_) = result.of_kind("suspected")
    assert told.signal == "flow" and 400 < told.row <= 520


def test_a_version_keeps_the_sizes_of_the_one_that_it_was_made_from(tmp_path: Path) -> None:
    with twin(1, tmp_path / "pump.db") as new:
        kept = new.keep(new.fit(recorded(1, 0)))
        new.promote(kept.number)
        made = new._ledger.keep(kept.form, {"gain": 1.0}, "by hand")
    assert [one.output for one in kept.sizes] == ["flow", "warm"] and made.sizes == kept.sizes
    assert Version.from_json(kept.to_json()) == kept
    old = {k: v for k, v in kept.to_json().items() if k != "sizes"}
    assert Version.from_json(old).sizes == ()
