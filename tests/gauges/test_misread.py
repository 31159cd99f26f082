"""Signs, units and columns of a base that are read wrongly are named, and not learned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from evertwin import RunResult, Twin, TwinSpec
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import CorrectionSpec, ModelSpec, PredictionSpec, Span
from planted.draws import first_of
from proofs.rates import TWIN, recording

Columns = dict[str, np.ndarray]
HALF = 1200


def driven(seed: int, rows: int = 2 * HALF) -> Columns:
    """A differential base at 20 Hz, its drive 4 % weaker than asked, recorded with noise."""
    rng, dt = np.random.default_rng(seed), 0.05
    v, w = (np.repeat(rng.uniform(a, b, rows // 20), 20) for a, b in ((-0.2, 0.6), (-1.0, 1.0)))
    heading = 0.3 + np.concatenate([[0.0], np.cumsum(0.97 * w * dt)[:-1]])
    middle = heading + 0.5 * 0.97 * w * dt
    x, y = (np.concatenate([[0.0], np.cumsum(0.96 * v * f(middle) * dt)[:-1]])
            for f in (np.cos, np.sin))  # fmt: skip
    noise = rng.normal(0.0, 0.003, (3, rows))
    turned = (heading + noise[2] + np.pi) % (2 * np.pi) - np.pi
    return {
        "t": dt * np.arange(rows), "v": v, "w": w, "x": x + noise[0], "y": y + noise[1],
        "heading": turned,
    }  # fmt: skip


def turned(name: str) -> Callable[[Columns, slice], None]:
    def change(data: Columns, rows: slice) -> None:
        data[name][rows] *= -1.0

    return change


def exchanged(a: str, b: str) -> Callable[[Columns, slice], None]:
    def change(data: Columns, rows: slice) -> None:
        data[a][rows], data[b][rows] = data[b][rows].copy(), data[a][rows].copy()

    return change


def in_degrees(data: Columns, rows: slice) -> None:
    data["heading"][rows] = np.degrees(data["heading"][rows])


def in_radians(data: Columns, rows: slice) -> None:
    data["heading"][rows] = np.radians(data["heading"][rows])


def run(data: Columns, **more: Any) -> RunResult:
    spec = TwinSpec(
        "base", ModelSpec("differential"), beat=Span(seconds=2.0), prediction=PredictionSpec(1.0),
        anomaly=AnomalySpec(
            requirement=0.03, relative=False, window=Span(seconds=20.0), outputs=("x", "y")
        ),
        correction=CorrectionSpec(channels=("v", "w"), terms=("lag", "law")), **more,
    )  # fmt: skip
    with Twin(spec) as twin:
        return twin.run(data)


CASES = [
    pytest.param(turned("w"), "the sign of w looks turned", id="turn"),
    pytest.param(turned("v"), "the sign of v looks turned", id="forward"),
    pytest.param(turned("heading"), "the sign of heading looks turned", id="heading"),
    pytest.param(exchanged("x", "y"), "x and y look exchanged", id="columns"),
    pytest.param(exchanged("v", "w"), "v and w look exchanged", id="commands"),
    pytest.param(in_degrees, "degrees for radians", id="degrees"),
    pytest.param(in_radians, "radians for degrees", id="radians"),
]


@first_of(("change", "said"), CASES)
def test_a_channel_read_wrongly_from_the_middle_on_is_named_and_not_learned(
    change: Callable[[Columns, slice], None], said: str
) -> None:
    data = driven(1)
    change(data, slice(HALF, None))
    result = run(data)
    assert said in result.headline
    assert all(e.row < HALF for e in result.of_kind("promoted", "corrected"))


@first_of(("change", "said"), CASES[::3])
def test_so_is_one_that_was_never_read_rightly(
    change: Callable[[Columns, slice], None], said: str
) -> None:
    data = driven(2)
    change(data, slice(0, None))
    result = run(data)
    assert said in result.headline
    assert not result.of_kind("promoted", "corrected")


@first_of("seed", [3, 4])
def test_a_sound_base_and_one_that_has_lost_speed_have_no_such_finding(seed: int) -> None:
    data = driven(seed)
    assert not run(data).of_kind("abnormal", "suspected")
    weak = driven(seed)
    weak["v"][HALF:] *= 2.2  # it goes less than half as fast as it is asked to
    assert not [e for e in run(weak).events if "number" in e.evidence]


def test_the_doctor_names_crossed_columns() -> None:
    data = driven(5)
    exchanged("x", "y")(data, slice(0, None))
    with Twin(TwinSpec("base", ModelSpec("differential"), prediction=PredictionSpec(1.0))) as twin:
        found = twin.doctor(data).of_kind("exchanged", "unit", "sign")
    assert [one.kind for one in found] == ["exchanged"]
    assert "x and y look exchanged" in found[0].reason


@first_of("seed", [14, 40])
def test_a_drive_that_stands_below_its_threshold_is_read_in_no_smaller_unit(seed: int) -> None:
    """What does not move has as little of any size; the noise of what moves later tells it."""
    with Twin.open(TWIN) as twin:
        result = twin.run(recording(seed, 10))
    told = [e.reason for e in result.of_kind("abnormal")]
    assert not any("times what it is" in reason for reason in told)
    assert "start threshold" in result.headline and result.of_kind("promoted")
