"""A contact in a whole twin: marked at its rows, told at the next beat, learned from by nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config.spec import (
    AnomalySpec,
    ClockSpec,
    ModelSpec,
    MovingSpec,
    Span,
    TuningSpec,
    TwinSpec,
)
from evertwin.fold import Block, Event, Mark, copy, load, make_block, save, take
from evertwin.fold.state import equal
from evertwin.loop.decisions.contacts import unsure
from evertwin.models.spec import ParameterSpec
from evertwin.rows.ring import Ring
from evertwin.setup.configured_model import model_of
from evertwin.sync.spec import SignalSpec
from planted.draws import first_of

from .test_strides import folded

TRUTH = {"mass": 90.0, "Fv": 200.0, "Fc": 20.0, "offset": 0.0}
AXIS = TwinSpec(
    "axis",
    ModelSpec("drive_force", {"law": "sign"}, {k: ParameterSpec(v) for k, v in TRUTH.items()}),
    beat=Span(50), clock=ClockSpec(rate=100.0), tuning=TuningSpec(window=Span(1500)),
    moving=MovingSpec(channels={"force": "speed"}, above=0.01),
    anomaly=AnomalySpec(requirement=0.1, window=Span(500)),
)  # fmt: skip
AT, LONG = 2510, 40
"""First row and rows of the contact, between two beats."""


def rows(
    contact: float = 0.0, wear: float = 0.0, load: float = 0.0, seed: int = 0, n: int = 4000
) -> Block:
    """An axis to and fro, pushed once; dry friction that grows, a force that stays."""
    t, rng = np.arange(n) / 100.0, np.random.default_rng(seed)
    v, a = 0.1 * np.sin(0.9 * t), 0.09 * np.cos(0.9 * t)
    model = model_of(AXIS)
    u = np.stack([v, a], axis=1)
    y = model.simulate(np.zeros(0), u, np.full(n, 0.01), model.parameters.values)[1]
    y += rng.normal(0.0, 0.5, y.shape)
    y[:, 0] += wear * np.sign(v) * (np.arange(n) >= 2000) + load * (np.arange(n) >= 2000)
    y[AT : AT + LONG] += contact
    return make_block(np.arange(n) * 10**7, u, y)


def kinds(said: list[str]) -> list[str]:
    names = ("external", "suspected", "tuned", "promoted")
    return [kind for one in said for kind in names if f'"kind":"{kind}"' in one]


@pytest.mark.parametrize("case", [{"contact": 30.0}, {"load": 15.0}, {"wear": 8.0}], ids=str)
def test_many_beats_at_once_are_beat_by_beat(case: dict[str, float]) -> None:
    block = rows(**case)
    whole, one_beat = folded(AXIS, block, 10**6), folded(AXIS, block, 49)
    assert whole[1] == one_beat[1] and equal(whole[0], one_beat[0])


def test_a_contact_is_told_at_the_next_beat_and_nothing_is_learned_from_it() -> None:
    with Twin(AXIS) as twin:
        result = twin.run((rows(contact=30.0),))
    (event,) = result.of_kind("external")
    assert event.signal == "force" and AT + LONG <= event.row <= AT + LONG + 70
    assert result.champion.number == 0 and not result.of_kind("tuned", "promoted")
    marked = np.flatnonzero(result.trace["mark"][:, 0] == Mark.EXTERNAL)
    assert AT < marked[0] <= AT + 20 and marked[-1] < AT + LONG + 20
    assert event.evidence["levels"][0] == pytest.approx(30.0, rel=0.1)
    assert f"rows left out of force: {len(marked)} pushed from outside" in result.text()


def test_rows_in_doubt_are_not_called_pushed() -> None:
    with Twin(AXIS) as twin:
        result = twin.run((rows(contact=30.0),))
    untold = replace(result, events=tuple(e for e in result.events if e.kind != "external"))
    pushed = f"{np.count_nonzero(result.trace['mark'] == Mark.EXTERNAL)} pushed from outside"
    assert pushed in result.text() and "in doubt" not in result.text()
    assert "pushed from outside" not in untold.text()
    assert pushed.replace("pushed from outside", "in doubt (a push, or the model)") in untold.text()


@first_of("seed", range(4))
def test_errors_that_grow_with_what_is_expected_are_no_contacts(seed: int) -> None:
    """Strokes ever faster, of a model that is off by a share of what it says."""
    rng = np.random.default_rng(seed)
    n = 6000
    t = np.arange(n) / 100.0
    size = np.where(t % 20.0 < 15.0, 0.05, rng.uniform(0.3, 0.6))
    v, a = size * np.sin(1.5 * t), 1.5 * size * np.cos(1.5 * t)
    model = model_of(AXIS)
    u = np.stack([v, a], axis=1)
    clean = model.simulate(np.zeros(0), u, np.full(n, 0.01), model.parameters.values)[1]
    y = clean + rng.normal(0.0, 0.5, clean.shape)
    y[:, 0] += 0.06 * np.abs(clean[:, 0]) * (1 + np.sin(7.0 * t + rng.uniform(0, 6)))
    said = folded(AXIS, make_block(np.arange(n) * 10**7, u, y), 500)[1]
    assert "external" not in kinds(said)


def test_a_fit_says_how_many_rows_it_leaves_out() -> None:
    block = rows()
    block.y[1200:1207] = 1e9
    with Twin(AXIS) as twin:
        found, clean = twin.fit((block,)), twin.fit((rows(),))
    assert found.spoiled == {"force": 7} and clean.spoiled == {}
    assert "rows left out that cannot be a measurement: 7 of force" in str(found)
    assert "left out" not in str(clean)


def test_a_fit_says_which_input_is_out_of_its_range() -> None:
    """A description's limits may be others than the machine's: nearly all rows are gone then."""
    block = rows()
    block.u[1200:3200, 0] += 100.0
    with Twin(replace(AXIS, signals={"speed": SignalSpec(low=-1.0, high=1.0)})) as twin:
        found = twin.fit((block,))
    assert found.spoiled == {"speed": 2000}
    assert "rows left out that cannot be a measurement: 2000 of speed" in str(found)


def test_the_kept_rows_of_a_contact_enter_no_fit() -> None:
    state, _ = folded(AXIS, take(rows(contact=30.0), 0, AT + 300), 100)
    assert (state.ring.mark[np.arange(AT, AT + LONG) % len(state.ring.t), -1] == 7).all()


def test_a_force_that_stays_is_the_machines_own_and_is_tuned() -> None:
    state, said = folded(AXIS, rows(load=15.0), 1000)
    assert "external" not in kinds(said) and "tuned" in kinds(said)
    kept = state.ring.mark[:, -1]
    assert (kept[np.arange(3000, 4000) % len(kept)] == Mark.OK).all()


def test_friction_that_grows_is_followed_as_before() -> None:
    _, said = folded(AXIS, rows(wear=8.0), 1000)
    unwatched = replace(AXIS, anomaly=replace(AXIS.anomaly, external=0.0))
    assert "external" not in kinds(said) and "tuned" in kinds(said)
    assert set(kinds(folded(unwatched, rows(wear=8.0), 1000)[1])) == set(kinds(said))


def test_a_contact_survives_a_break() -> None:
    block = rows(contact=30.0)
    whole, _ = folded(AXIS, block, 1000)
    half, _ = folded(AXIS, take(block, 0, AT + 25), 1000)
    assert equal(load(save(copy(half.external)), like=half.external), half.external)
    assert whole.external.ring.shape == (3, 20, 1)


def test_without_a_rate_or_with_a_state_nothing_is_looked_for() -> None:
    with Twin(replace(AXIS, clock=ClockSpec())) as twin:
        assert twin.setup.external.longest == 0.0
    with Twin(TwinSpec("cart", ModelSpec("robot1d"), clock=ClockSpec(rate=100.0))) as twin:
        assert twin.setup.external.longest == 0.0


@pytest.mark.parametrize(("marked", "kind"), [(6, "not_judged"), (2, "measurement_error")])
def test_a_failed_vote_accuses_no_sensor_where_something_outside_acts(
    marked: int, kind: str
) -> None:
    """Rows 4 to 9, of which the ring holds the first three."""
    rows = make_block(t=range(12), u=np.zeros((12, 1)), y=np.zeros((12, 1)))
    rows.mark[4 : 4 + marked, 1] = Mark.EXTERNAL
    before, here = take(rows, 0, 7), take(rows, 7, 12)
    ring = Ring(capacity=5, nu=1, ny=1)
    told = Event(10, 10, "measurement_error", "tau", "", {"cause": "vote", "onset": 4, "end": 9})
    frozen = Event(
        10, 10, "measurement_error", "tau", "", {"cause": "frozen", "onset": 4, "end": 9}
    )
    found = unsure((told, frozen), ring.push(ring.init(), before), here)
    assert [event.kind for event in found] == [kind, "measurement_error"]


def test_a_turned_sign_is_named_and_no_push() -> None:
    block = rows()
    block.y[2500:3100] *= -1.0  # 6 s: to and fro
    with Twin(AXIS) as twin:
        result = twin.run((block,))
    named = [e for e in result.of_kind("abnormal") if "turned" in e.reason]
    assert named and 2500 < named[0].row <= 3300
    assert named[0].evidence["number"] == pytest.approx(-1.0, rel=0.05)
    assert result.champion.number == 0 and "omething outside" not in result.headline


def test_a_speed_that_no_longer_answers_is_no_push_and_no_worn_place() -> None:
    """Its sensor stays at zero while the machine is driven on, more slowly than a contact lasts."""
    block = rows(seed=3)
    u = block.u.copy()
    u[2000:] = 0.0
    parts = [folded(AXIS, block._replace(u=u), size) for size in (10**6, 37)]
    assert parts[0][1] == parts[1][1]  # wherever the rows are cut
    state, said = parts[0]
    told = [one for one in said if "has not changed since row 2000" in one]
    assert len(told) == 1 and '"signal":"speed"' in told[0]
    assert not any('"kind":"recurring"' in one or '"kind":"tuned"' in one for one in said)
    assert np.isnan(state.recurrence.places).all()


@first_of("seed", [3, 4, 5])
def test_a_speed_that_no_longer_answers_may_scatter(seed: int) -> None:
    block, rng = rows(seed=seed), np.random.default_rng(seed)
    u = block.u.copy()
    u[2000:] = rng.normal(0.0, [1e-4, 1e-3], u[2000:].shape)
    parts = [folded(AXIS, block._replace(u=u), size) for size in (10**6, 37)]
    assert parts[0][1] == parts[1][1]  # wherever the rows are cut
    said = parts[0][1]
    told = [one for one in said if '"kind":"abnormal"' in one and '"signal":"speed"' in one]
    assert len(told) == 1 and "speed has not moved since row " in told[0]
    assert not set(kinds(said)) & {"external", "tuned", "promoted"}


@first_of("seed", range(3, 9))
def test_a_machine_that_goes_slowly_is_no_sensor(seed: int) -> None:
    """Slower than what counts as moving, at any share of that and noise: friction turns with it."""
    block, rng = rows(seed=seed), np.random.default_rng(seed)
    u, y = block.u.copy(), block.y.copy()
    slow = slice(2000, 3500)
    u[slow] *= rng.uniform(0.01, 0.09)
    u[:, 0] += rng.normal(0.0, 10 ** rng.uniform(-5.0, -3.5), len(u))
    y[slow, 0] = TRUTH["Fc"] * np.sign(block.u[slow, 0]) + rng.normal(0.0, 0.5, 1500)
    said = folded(AXIS, block._replace(u=u, y=y), 500)[1]
    assert not any("its sensor" in one for one in said)


def test_a_speed_that_answers_again_is_judged_again() -> None:
    block, rng = rows(seed=3, wear=8.0), np.random.default_rng(3)
    u = block.u.copy()
    u[1000:1600] = rng.normal(0.0, [1e-4, 1e-3], (600, 2))
    state, said = folded(AXIS, block._replace(u=u), 500)
    assert any("has not moved since row" in one for one in said)
    assert not state.still.said.any() and "tuned" in kinds(said)


@pytest.mark.parametrize("force", [40.0, -60.0])
def test_a_push_on_a_machine_that_stands_is_no_sensor(force: float) -> None:
    """It had stood for four seconds, and moves on later; its speed scatters."""
    block, rng = rows(seed=3), np.random.default_rng(3)
    u, y = block.u.copy(), block.y.copy()
    still = slice(2000, 2800)
    u[still] = rng.normal(0.0, [1e-4, 1e-3], (800, 2))
    y[still] = rng.normal(0.0, 0.5, (800, 1))
    y[2450:2550] += force
    said = folded(AXIS, block._replace(u=u, y=y), 500)[1]
    assert not any("has not moved" in one for one in said)


@pytest.mark.parametrize("stands", [True, False])
def test_a_position_that_stands_too_speaks_for_its_speed(stands: bool) -> None:
    """What moves the force while both stand acts from outside; one that goes on tells of the
    speed's sensor."""
    block, options = rows(seed=3), {"law": "sign+spring"}
    sprung = replace(AXIS, model=replace(AXIS.model, options=options))
    position, speed = -0.1 / 0.9 * np.cos(0.009 * np.arange(4000)), block.u.copy()
    speed[2000:] = 0.0
    position[2000:] = position[2000] if stands else position[2000:]
    position += np.random.default_rng(4).normal(0.0, 1e-5, 4000)
    names = model_of(sprung).inputs.names
    u = np.stack([{"position": position}.get(n, speed[:, names.index(n) % 2]) for n in names], 1)
    said = folded(sprung, make_block(block.t, u, block.y), 500)[1]
    assert any("speed has not " in one for one in said) is not stands


def test_a_machine_may_stand_as_long_as_it_likes() -> None:
    block = rows(seed=3)
    u, y = block.u.copy(), block.y.copy()
    u[2000:], y[2000:] = 0.0, np.random.default_rng(1).normal(0.0, 0.5, y[2000:].shape)
    said = folded(AXIS, block._replace(u=u, y=y), 500)[1]
    assert not any("has not changed" in one or "has not moved" in one for one in said)


@first_of("seed", range(6))
def test_a_force_that_reads_a_share_less_is_no_push(seed: int) -> None:
    """It goes beyond what is usual for a while, now and then: wherever much is predicted."""
    n, rng = 6000, np.random.default_rng(seed)
    t = np.arange(n) / 100.0
    parts = [(0.1 / k, 0.5 * k, rng.uniform(0.0, 2.0 * np.pi)) for k in range(1, 6)]
    v = sum(size * np.sin(w * t + at) for size, w, at in parts)
    a = sum(size * w * np.cos(w * t + at) for size, w, at in parts)
    heavy = replace(
        AXIS, model=replace(AXIS.model, parameters=AXIS.model.parameters | {
            "mass": ParameterSpec(2000.0),
        }),
    )  # fmt: skip
    model = model_of(heavy)
    u = np.stack([v, a], axis=1)
    y = model.simulate(np.zeros(0), u, np.full(n, 0.01), model.parameters.values)[1]
    y[3000:] *= 0.8
    y += rng.normal(0.0, 12.0, y.shape)
    with Twin(heavy) as twin:
        result = twin.run((make_block(np.arange(n) * 10**7, u, y),))
    assert not result.of_kind("external")
    pushed = y.copy()
    pushed[3000:] = y[3000:] / 0.8
    pushed[3500:3550] += 200.0
    with Twin(heavy) as twin:
        result = twin.run((make_block(np.arange(n) * 10**7, u, pushed),))
    assert len(result.of_kind("external")) == 1


@pytest.mark.parametrize("end", [2770, 2799, 2801])
def test_rows_of_a_speed_that_did_not_answer_are_in_no_window(end: int) -> None:
    """Nor those after it whose acceleration looks back at them, wherever the beat lies."""
    block = rows(seed=6)
    u = block.u.copy()
    u[2000:end] = u[2000]
    state, said = folded(AXIS, block._replace(u=u), 37)
    kept = np.arange(2000, state.ring.end) % len(state.ring.t)
    assert state.ring.out[kept[: end - 2000]].all(), "also those since the newest beat"
    assert not state.ring.out[kept[850:]].any()
    told = [one for one in said if '"kind":"abnormal"' in one]
    assert len(told) == 1 and '"signal":"speed"' in told[0]
    assert "tuned" not in kinds(said)


@pytest.mark.parametrize("at", [60, -30])
@first_of("seed", range(3))
def test_a_contact_about_a_promotion_is_told(seed: int, at: int) -> None:
    """How far the new version is usually off is known by the rows before it went live."""
    worn = rows(wear=8.0, seed=seed, n=7000)
    with Twin(AXIS) as twin:
        (live,) = twin.run((worn,)).of_kind("promoted")
    pushed = worn.y.copy()
    pushed[live.row + at : live.row + at + LONG] += 30.0
    with Twin(AXIS) as twin:
        result = twin.run((worn._replace(y=pushed),))
    (contact,) = result.of_kind("external")
    assert abs(contact.evidence["first"] - live.row - at) <= 10
    assert len(result.of_kind("promoted")) == 1 and result.champion.number == 1
