"""A machine that changed keeps its law where numbers of it explain the change."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec as config
from evertwin.fold import Block, make_block
from evertwin.refit.numbers.simplest import law_now
from evertwin.refit.work import Work
from evertwin.setup.friction_law import climb_laws
from evertwin.setup.setup import Setup
from evertwin.setup.task import Task
from evertwin.tuning import Problem

LAW = "sign+direction+stribeck+position"
KNOWN = {"mass": 30.0, "Fv": 60.0, "Fc": 40.0, "offset": 0.0, "Fqs": 4.0}
RATE = 100


def rows(true: dict[str, float], seconds: float, start: int = 0) -> Block:
    """An axis that moves to and fro; noise that is alike from row to row, as of a rough rail."""
    rng = np.random.default_rng(4)
    t = (start + np.arange(int(seconds * RATE))) / RATE
    q = 0.3 * np.sin(1.1 * t) + 0.1 * np.sin(2.7 * t)
    v = np.gradient(q, t)
    a = np.gradient(v, t)
    friction = (true["Fc"] + true["Fqs"] * np.sin(q)) * np.sign(v)
    rough = 4.0 * np.sin(2 * np.pi * q / 0.1) + rng.normal(0.0, 0.5, len(t))
    y = true["mass"] * a + (true["Fv"] + true.get("more", 0.0) * (v < 0)) * v + friction + rough
    u = np.stack([v, a, q], axis=1)
    return make_block(t=np.arange(len(t)) * (10**9 // RATE), u=u, y=y[:, None], row=start)


def opened() -> Twin:
    names = ("mass", "Fv", "Fv_back", "Fc", "offset", "Fs", "Fqc", "Fqs")
    return Twin(
        TwinSpec(
            "axis", config.ModelSpec("drive_force", {"law": LAW}),
            moving=config.MovingSpec(above=0.02, channels={"force": "speed"}, tune=True),
            anomaly=config.AnomalySpec(requirement=0.15),
            tuning=config.TuningSpec(
                editable=names, ladder=("direction", "stribeck", "position")
            ),
        )
    )  # fmt: skip


def posed(twin: Twin, block: Block) -> tuple[Work, Problem]:
    work = Work(Setup(twin.spec, twin.model), twin._versions)
    version = twin._ledger.keep(twin._versions[0].form, KNOWN, "as it was")
    return work, work.problem(version, (block,), work.editable(version))


def test_dry_friction_that_grew_is_told_as_such_on_few_rows() -> None:
    with opened() as twin:
        work, problem = posed(twin, rows(KNOWN | {"Fc": 52.0}, 4.0))
        assert climb_laws(work.setup, problem)[0].names != ("mass", "Fv", "Fc", "offset")
        known, chosen = law_now(work.setup, problem, work.tune)
        assert known.names == ("mass", "Fv", "Fc", "offset") and not chosen.laws
        assert work.tune(known)[1]["Fc"] == pytest.approx(52.0, rel=0.05)


def test_what_the_law_does_not_reach_asks_for_a_term() -> None:
    with opened() as twin:
        work, problem = posed(twin, rows(KNOWN | {"more": 300.0}, 20.0))
        wider, chosen = law_now(work.setup, problem, work.tune)
        assert "Fv_back" in wider.names and "backwards" in chosen.said


def test_a_law_that_never_held_climbs() -> None:
    with opened() as twin:
        work, problem = posed(twin, rows(KNOWN | {"more": 100.0}, 20.0))
        assert (
            law_now(work.setup, problem, None)[0].names == climb_laws(work.setup, problem)[0].names
        )


def test_a_candidate_names_what_moved_though_it_is_weak() -> None:
    with opened() as twin:
        work, problem = posed(twin, rows(KNOWN | {"Fc": 52.0}, 4.0))
        task = Task("fit", twin._versions[1], problem.windows, 0)
        found = work.content(task)["candidate"]
        assert isinstance(found, dict) and "offset (weak)" in str(found["reason"])
