"""What changed is told from what was live before, the largest first, in headline and events."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evertwin.config.spec import (
    AnomalySpec,
    ArbiterSpec,
    ModelSpec,
    PredictionSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.fold import Event
from evertwin.models.form import Form, Term, Version
from evertwin.outcome.course.changes import changes, in_words
from evertwin.refit.tuner.judgement import partly
from evertwin.twin import Twin
from planted.draws import first_of

NAMES = ("Fv", "Fc", "offset", "mass")
UNITS = {"Fv": "Ns/m", "Fc": "N", "offset": "N", "mass": "kg"}


def test_what_moved_most_by_its_interval_is_first() -> None:
    moves = [("Fv", 303.0, 296.0), ("offset", -0.1, 0.3), ("mass", 80.1, 111.0)]
    halves = {"Fv": 5.0, "offset": 0.2, "mass": 0.5}
    assert in_words(moves, UNITS, halves).startswith("mass 80.1 → 111 kg, offset")
    some = {"Fv": 5.0, "mass": 0.5}  # of the offset no interval is known
    assert in_words(moves, UNITS, some).startswith("mass 80.1 → 111 kg, Fv")
    assert in_words(moves, UNITS, {}).startswith("offset")
    assert in_words(moves, UNITS, {}, ["offset"]).startswith("mass 80.1 → 111 kg, Fv")
    alike = [("Fv", 303.0, 296.0), ("mass", 80.1, 111.0)]
    assert in_words(alike, UNITS, {}) == "mass 80.1 → 111 kg, Fv 303 → 296 Ns/m"


def test_a_version_is_told_from_the_one_before_with_the_intervals_of_its_fit() -> None:
    with Twin(TwinSpec("axis", ModelSpec("drive_force"))) as twin:
        names = twin.setup.model.parameters.names
        reason = "tuned Fv, Fc, offset, mass"
        first = dict(zip(names, twin.champion.values, strict=True))
        old = first | dict(zip(NAMES, (303.0, 119.0, 14.9, 80.0), strict=True))
        now = first | dict(zip(NAMES, (296.0, 122.0, 17.0, 110.0), strict=True))
        one, two = (
            Version(k, twin.champion.form, names, tuple(v[n] for n in names), k - 1, reason)
            for k, v in ((1, old), (2, now))
        )
        halves = {"Fv": 5.0, "Fc": 0.02, "offset": 4.0, "mass": 1.0}
        known = {n: {"value": now[n], "interval95": (now[n] - h, now[n] + h)}
                 for n, h in halves.items()}  # fmt: skip
        fit = Event(9, 0, "tuned", "", reason, {"parameters": known})
        assert changes(twin.setup, (two, one)).startswith("mass 80 → 110 kg")
        assert changes(twin.setup, (two, one), [fit]).startswith("Fc 119 → 122 N, mass 80 → 110 kg")


@first_of("seed", [1, 2])
def test_events_and_headline_count_from_what_was_live(seed: int) -> None:
    spec = TwinSpec(
        "robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
        arbiter=ArbiterSpec(use="tolerance", tolerance=0.03), beat=Span(10),
        anomaly=AnomalySpec(requirement=0.005, relative=False, window=Span(100)),
        tuning=TuningSpec(window=Span(600)),
    )  # fmt: skip
    rng, t = np.random.default_rng(seed), 0.1 * np.arange(4000)
    v = 0.1 * np.sign(np.sin(0.4 * t)) + 0.05 * np.sin(1.3 * t)
    gain = np.where(np.arange(4000) < 2000, 0.9, 0.7)
    x = np.concatenate([[0.0], np.cumsum(0.1 * (gain * v)[:-1])])
    with Twin(spec) as twin:
        result = twin.run({"t": t, "v": v, "x": x + rng.normal(0.0, 0.001, 4000)})
    went = result.of_kind("promoted")
    assert len(went) >= 2 and "gain 1 → 0." in went[0].reason
    last = went[-1].evidence
    assert last["replaced"] == went[-2].evidence["version"]
    old, new = (result.versions[last[which]].values[0] for which in ("replaced", "version"))
    assert f"Changed by itself: gain 1 → {old:.3g} → {new:.3g}" in result.headline and old < 0.95
    assert all(" → " in event.reason for event in result.of_kind("tuned"))


def test_a_fit_of_some_names_them() -> None:
    many = [f"p{k}" for k in range(9)]
    assert "only p0, p1 were due" in partly(many[:2], many[2:]).reason
    assert (
        "p5 and 2 more were due to be fitted this time; the 1 other keeps its value"
        in partly(many[:8], many[8:]).reason
    )
    assert replace(partly(many[:1], many), kind="x").reason.startswith("only p0 was due")


def test_a_form_that_came_with_its_threshold_is_told_as_one() -> None:
    with Twin(TwinSpec("cart", ModelSpec("robot1d"))) as twin:
        form = Form((Term("law", "v", variant="dead zone"),))
        names = twin._versions.model_of(form).parameters.names
        values = (1.0, 0.1, 1.0, 0.0, 1e9)
        moved = Version(2, form, names, values, 1, "tuned law.v.threshold")
        said = changes(twin.setup, (moved, twin.champion))
        assert said == "v: start threshold 0.1 m/s (dead zone)"


def test_a_term_that_came_on_the_way_is_told_beside_what_came_last() -> None:
    with Twin(TwinSpec("cart", ModelSpec("robot1d"))) as twin:
        form = Form((Term("law", "v", variant="dead zone"),))
        names = twin._versions.model_of(form).parameters.names
        came = Version(1, form, names, (1.0, 0.1, 1.0, 0.0, 1e9), 0, "v: start threshold 0.1 m/s")
        moved = Version(2, form, names, (1.2, 0.1, 1.0, 0.0, 1e9), 1, "tuned gain")
        said = changes(twin.setup, (moved, came, twin.champion))
        assert said == "gain 1 → 1.2; v: start threshold 0.1 m/s (dead zone)"


def test_what_wears_leads_what_a_machine_is_built_of_and_what_is_weak_comes_last() -> None:
    moves = [("link.Ixx", 0.1, 2.0), ("Fc", 303.0, 296.0), ("offset", 0.0, 5.0)]
    units, halves = {"link.Ixx": "kg*m^2", "Fc": "N", "offset": "N"}, {"link.Ixx": 0.01, "Fc": 1.0}
    told = in_words(moves, units, halves, ["offset"], later=("link.Ixx",))
    assert told == "Fc 303 → 296 N, link.Ixx 0.1 → 2 kg*m^2, offset 0 → 5 N (weak)"
