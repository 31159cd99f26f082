"""A load comes and goes: told by its mass, adopted within seconds, never learned as wear."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evertwin import RunResult, Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ModelSpec, MovingSpec, ParameterSpec, Span, TuningSpec
from evertwin.errors import UsageError
from evertwin.fold import make_block
from evertwin.models.form import Version
from evertwin.tuning.spec import StateSpec

RATE, SECONDS = 20.0, 100
CAME, WENT = 40.0, 70.0
REST = {"mass": 90.0, "Fv": 200.0, "Fc": 20.0, "offset": 0.0}
SPEC = TwinSpec(
    "table",
    ModelSpec("drive_force", {}, {n: ParameterSpec(value=v) for n, v in REST.items()}),
    beat=Span(seconds=1.0),
    moving=MovingSpec(above=0.01, channels={"force": "speed"}),
    anomaly=AnomalySpec(requirement=0.05, window=Span(seconds=10.0)),
    tuning=TuningSpec(
        editable=("Fv", "Fc"),
        window=Span(seconds=30.0),
        causes={"friction": ("Fv", "Fc"), "load": ("mass",)},
        states={"load": StateSpec("mass", "moves", "load put down")},
    ),
)  # fmt: skip


def run(
    mass: float = 0.0, rubs: float = 0.0, last: float = WENT, seconds: float = SECONDS,
    spec: TwinSpec = SPEC, reads: float = 1.0, smooth: float = 1.0,
) -> tuple[RunResult, Version]:  # fmt: skip
    """A table that carries ``mass``, rubs more by ``rubs`` and whose sensor ``reads`` so many times
    as much from 40 s on, until ``last``; ``smooth``: part of the friction that it has."""
    rng = np.random.default_rng(1)
    t = np.arange(round(seconds * RATE)) / RATE
    rates, phases = np.array([0.9, 2.3, 4.1]), rng.uniform(0.0, 6.0, 3)
    v = (0.1 * np.sin(np.outer(t, rates) + phases)).sum(axis=1)
    a = (0.1 * rates * np.cos(np.outer(t, rates) + phases)).sum(axis=1)
    on = (t >= CAME) & (t < last)
    rubbing = 200.0 * v + (20.0 + rubs * on) * np.sign(v)
    force = (REST["mass"] + mass * on) * a + smooth * rubbing
    force *= np.where(on, reads, 1.0)
    rows = make_block(
        t=np.round(t * 1e9).astype(np.int64), u=np.stack([v, a], axis=1),
        y=(force + rng.normal(0.0, 0.5, len(t)))[:, None],
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.run(rows), twin.champion


@pytest.fixture(scope="module")
def loaded() -> tuple[RunResult, Version]:
    return run(mass=35.0)


def test_a_load_is_told_by_its_mass_and_live_within_ten_seconds(loaded: Any) -> None:
    came = loaded[0].of_kind("state")[0]
    assert came.signal == "load"
    assert came.reason.startswith("moves 125 ± ")
    assert came.reason.endswith("kg since row 800 (40.0 s)")
    assert CAME < came.time * 1e-9 <= CAME + 10.0
    live = next(e for e in loaded[0].of_kind("promoted") if e.row == came.row)
    assert "not reached" not in live.reason


def test_it_is_told_when_it_was_put_down(loaded: Any) -> None:
    gone = loaded[0].of_kind("state")[-1]
    assert gone.reason.startswith("load put down at row 1")
    assert gone.reason.endswith(" (70.0 s), after 125 kg")
    assert WENT < gone.time * 1e-9 <= WENT + 10.0


def test_nothing_is_learned_as_wear(loaded: Any) -> None:
    result, champion = loaded
    assert {e.row for e in result.of_kind("promoted")} == {e.row for e in result.of_kind("state")}
    assert dict(zip(champion.names, champion.values, strict=True)) == REST


@pytest.mark.parametrize("beat, window", [(0.5, 5.0), (2.0, 20.0)])
def test_other_settings_come_to_the_same(beat: float, window: float) -> None:
    spec = replace(
        SPEC, beat=Span(seconds=beat),
        anomaly=replace(SPEC.anomaly, window=Span(seconds=window)),
    )  # fmt: skip
    result, champion = run(mass=35.0, spec=spec)
    told = result.of_kind("state")
    assert (told[0].reason[:9], told[-1].reason[:13]) == ("moves 125", "load put down")
    assert champion.values == tuple(REST.values())


def test_what_rubs_more_is_no_load() -> None:
    result, champion = run(rubs=8.0, seconds=120.0, last=120.0)
    assert not result.of_kind("state")
    own = dict(zip(champion.names, champion.values, strict=True))
    assert own["mass"] == REST["mass"]
    assert own["Fc"] == pytest.approx(28.0, abs=1.0)


@pytest.mark.parametrize("reads", [0.75, 1.3])
def test_a_sensor_that_reads_otherwise_is_no_load(reads: float) -> None:
    """A mass explains nearly as much, of a table that hardly rubs."""
    values = {n: v * (0.1 if n in ("Fv", "Fc") else 1.0) for n, v in REST.items()}
    model = ModelSpec("drive_force", {}, {n: ParameterSpec(value=v) for n, v in values.items()})
    result, champion = run(reads=reads, smooth=0.1, spec=replace(SPEC, model=model))
    assert not result.of_kind("state")
    assert dict(zip(champion.names, champion.values, strict=True))["mass"] == REST["mass"]


def test_a_load_that_is_there_for_seconds_is_not_taken_on() -> None:
    result, champion = run(mass=35.0, last=CAME + 3.0, seconds=70.0)
    assert champion.number == 0
    assert not result.of_kind("state")


def test_a_state_has_a_cause_and_a_number_of_it() -> None:
    with pytest.raises(UsageError, match="causes has none"):
        TuningSpec(states={"load": StateSpec("mass")})
    tuning = replace(SPEC.tuning, states={"load": StateSpec("Fc")})
    with pytest.raises(UsageError, match=r"none of the parameters of causes\.load: mass"):
        Twin(replace(SPEC, tuning=tuning))


@pytest.mark.parametrize(
    ("key", "named"),
    [("once", ("base*",)), ("causes", {"wear": ("base*",)}), ("editable", ("b*",))],
)
def test_a_pattern_that_fits_no_parameter_is_refused_before_a_row_comes(
    key: str, named: Any
) -> None:
    tuning = replace(SPEC.tuning, states={}, **{key: named})
    with pytest.raises(UsageError, match=rf"\[tuning\] {key}.*no parameter matches 'b.*there are"):
        Twin(replace(SPEC, tuning=tuning))


def test_numbers_that_are_tuned_once_stay_when_the_twin_has_held() -> None:
    tuning = replace(SPEC.tuning, editable=("mass", "Fv", "Fc"), states={}, once=("mass",))
    result, champion = run(rubs=8.0, seconds=120.0, last=120.0, spec=replace(SPEC, tuning=tuning))
    own = dict(zip(champion.names, champion.values, strict=True))
    assert own["mass"] == REST["mass"]
    assert own["Fc"] == pytest.approx(28.0, abs=1.0)
    assert result.of_kind("promoted")
