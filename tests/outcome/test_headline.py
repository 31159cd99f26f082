"""The first sentence of a result: better, as before, on trial, not judged, off: each says which."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.config.read import reads
from evertwin.config.spec import AnomalySpec, ModelSpec, MovingSpec, PredictionSpec, TwinSpec
from evertwin.correction.spec import CorrectionSpec
from evertwin.errors import UsageError
from evertwin.fold import Event
from evertwin.outcome.course.jumps import usual_most
from evertwin.outcome.course.lives import went_back
from evertwin.outcome.headline import first_of_rows, headline
from evertwin.outcome.open.faults import open_faults
from evertwin.outcome.open.on_trial import OpenTrial
from evertwin.outcome.result import OutputFigures
from evertwin.signals.spoken import both, spoken
from evertwin.sources.clocks.tally import Tally
from evertwin.sources.columns.table import Problem
from evertwin.sources.spec import ChannelSpec, SourceSpec
from evertwin.twin import Twin

ROBOT = TwinSpec(
    "robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0),
    anomaly=AnomalySpec(requirement=0.01, relative=False),
)  # fmt: skip


def figures(before: float, after: float) -> dict[str, OutputFigures]:
    return {"x": OutputFigures("m", before, after, 0.2, 0.1, 0.2, 0.1, 100, 100, after)}


def said(
    spec: TwinSpec, before: float, after: float, *kinds: str, version: int = 0,
    reason: str = "tuned gain", trial: OpenTrial | None = None,
) -> str:  # fmt: skip
    with Twin(spec) as twin:
        first = twin.champion
        champion = replace(first, number=version, reason=reason if version else first.reason)
        events = [
            Event(5, 0, kind, "x", "", {"dependence": {"input": "v"}} if kind == "abnormal" else {})
            for kind in kinds
        ]
        return headline(twin.setup, figures(before, after), (champion,), events, trial)


def test_what_went_back_is_not_called_live_where_another_was_pinned_since() -> None:
    went = Event(9, 0, "promoted", "", "2 replaces 1, e-value 9; c 1 → 2", {"version": 2})
    back = Event(19, 0, "rolled_back", "", "", {"version": 1})
    assert "version 1, which is live again" in went_back([went, back], 1)[0]
    assert went_back([went, back], 2) == ()
    outdone = replace(back, evidence={"version": 1, "since": 12, "segments": 9, "left": 0.6})
    (told,) = went_back([went, outdone], 1)
    assert "neither is within what is asked" in told and "repair" not in told


def test_what_went_back_by_a_trial_is_told_as_what_was_rolled_back() -> None:
    """Three times the machine became another one, the last time in two steps."""
    events, row = list[Event](), 0
    for number in (1, 2, 3):
        made = f"{number} replaces 0, e-value 9; gain 1 → 0.{number}"
        events.append(Event(row + 10, 0, "promoted", "", made, {"version": number, "replaced": 0}))
        row += 100
        events.append(Event(row - 20, 0, "changed", "", "", {"row": row - 30}))
        events.append(Event(row, 0, "promoted", "", "", {"version": 0, "replaced": number}))
    more = {"version": 4, "replaced": 3}
    events.insert(-2, Event(250, 0, "promoted", "", "4 replaces 3, e-value 9; gain 1 → 0.4", more))
    events[-1] = Event(300, 0, "promoted", "", "", {"version": 0, "replaced": 4})
    (said,) = went_back(events, 0)
    assert said.startswith("Versions 3, 4 (gain 1 → 0.4) were live from row 210 to 300; from row 2")
    assert said.endswith("70 on the machine is again as at version 0, as after a repair.")
    assert went_back(events[:-1], 4) == () == went_back(events, 4)
    with Twin(ROBOT) as twin:
        told = [Event(5, 0, "suspected", "x", "x is off", {}), *events]
        text = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), told, None)
        later = [*told, Event(350, 0, "suspected", "x", "x is off", {})]
        again = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), later, None)
    assert text.startswith("The twin fits its machine again: x is off by 4 mm")
    assert "Versions 3, 4" in text and "suspected" not in text
    assert "suspected 1 time" in again and "Versions 3, 4" in again


def test_what_is_named_for_no_channel_is_no_name() -> None:
    outside = Event(5, 0, "abnormal", "", "outside what it has seen", {"number": 1.0})
    level = Event(9, 0, "abnormal", "x", "x looks off by 3 mm", {"number": 1.0})
    with Twin(ROBOT) as twin:
        told = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), [outside, level], None)
    assert "x looks off by 3 mm" in told and "was named" not in told


def test_better_is_said_in_millimetres_with_what_was_changed() -> None:
    text = said(ROBOT, 0.029, 0.004, "suspected", "promoted", version=1)
    assert text.startswith("The twin fits its machine now: x is off by 4 mm instead of 29 mm")
    assert "(rms, predicted 1 s ahead), where 10 mm is asked" in text
    assert text.endswith("Changed: gain 1 → 1.")
    short = said(ROBOT, 0.029, 0.014, "suspected", "promoted", version=1)
    assert (
        "is closer to its machine" in short
        and "Still, x is off by 14 mm where 10 mm is asked" in short
    )


def test_a_version_that_is_no_better_is_not_called_better() -> None:
    text = said(ROBOT, 0.004, 0.005, "suspected", "promoted", version=1)
    assert "no better than the first" in text and "closer" not in text


def test_few_rows_since_a_version_went_live_tell_nothing_of_it() -> None:
    few = {name: replace(f, rows=4) for name, f in figures(0.029, 0.004).items()}
    with Twin(ROBOT) as twin:
        champion = replace(twin.champion, number=1, reason="tuned gain")
        text = headline(twin.setup, few, (champion,), [], None)
    assert "4 predictions since then are too few" in text and "closer" not in text


def test_within_the_requirement_nothing_was_changed() -> None:
    assert said(ROBOT, 0.004, 0.004).startswith(
        "The twin fits its machine, and nothing was changed"
    )


def test_off_says_what_would_help() -> None:
    text = said(ROBOT, 0.03, 0.03, "suspected", "abnormal")
    assert "x is off by 30 mm" in text and "where 10 mm is asked" in text
    assert 'it depends on v. To let the twin learn that, add [correction] channels = ["v"]' in text
    rule = CorrectionSpec(channels=("v",), terms=("law",))
    tried = said(replace(ROBOT, correction=rule), 0.03, 0.03, "suspected", "abnormal", "rejected")
    assert "nothing better was found: 1 candidate was tried" in tried


def test_off_at_the_end_is_never_called_fitting() -> None:
    """Whatever the events of this run say: a deviation that a run before told of is not told of
    again while a candidate is on trial."""
    assert said(ROBOT, 0.03, 0.03).startswith(
        "The twin does not fit its machine: x is off by 30 mm where 10 mm is asked"
    )
    better = said(ROBOT, 0.06, 0.03, "promoted", version=1)
    assert "closer" in better and "Still, x is off by 30 mm where" in better


def test_contacts_that_come_again_and_again_are_doubted() -> None:
    few, many = (said(ROBOT, 0.004, 0.004, *["external"] * n) for n in (9, 10))
    assert "may be the machine's own" not in few
    assert "acted on the machine 10 times" in many and "may be the machine's own" in many


def test_a_recording_that_does_not_fill_the_window_says_why_nothing_was_sought() -> None:
    with Twin(ROBOT) as twin:
        rows = twin.setup.enough
        short, whole = (
            headline(twin.setup, figures(0.03, 0.03), (twin.champion,), [], None, measured)
            for measured in (rows - 1, rows)
        )
    assert f"{rows - 1} rows are fewer than the {rows} of [anomaly] window" in short
    assert whole.endswith("and nothing better has been found yet.")


def test_where_the_machine_went_is_told_behind_what_came_of_it() -> None:
    went = "outside what it has seen before row 9: v was never above 1, and is now at 2"
    with Twin(ROBOT) as twin:
        for signal, reason in (("", went), ("v", "v is off by a factor of 2")):
            event = Event(9, 0, "abnormal", signal, reason, {"number": 1.0})
            better = replace(twin.champion, number=1, reason="tuned gain")
            told = headline(twin.setup, figures(0.03, 0.002), (better,), [event], None)
            assert told.startswith("V is off" if signal else "The twin fits its machine now")
            assert reason[1:] in told


def test_within_but_suspected_says_both() -> None:
    text = said(ROBOT, 0.004, 0.004, "drift")
    assert text.startswith("Over all rows the twin is within what is asked: x is off by 4 mm")
    assert "suspected 1 time (x: )" in text and "nothing better has been found yet" in text


def test_what_was_suspected_and_passed_is_no_doubt_any_more() -> None:
    events = [Event(row, 0, kind, "x", "x is off", {}) for row, kind in
              ((5, "suspected"), (9, "abnormal"))]  # fmt: skip
    with Twin(ROBOT) as twin:
        rows = 3 * twin.setup.enough
        held = {n: replace(f, held=True) for n, f in figures(0.004, 0.004).items()}
        passed, off = (
            headline(twin.setup, some, (twin.champion,), events, None, rows)
            for some in (held, figures(0.004, 0.004))
        )
        recent = [replace(events[0], row=rows - 5)]
        again = headline(twin.setup, held, (twin.champion,), recent, None, rows)
        named = [*events, Event(12, 0, "abnormal", "x", "x looks off by 3 mm", {"number": 1.0})]
        sensor = headline(twin.setup, held, (twin.champion,), named, None, rows)
    assert passed.startswith("The twin fits its machine, and nothing was changed")
    assert passed.endswith("It was suspected 1 time, last at row 5, and has held since.")
    assert "it was suspected 1 time (x: x is off), and nothing better" in off
    assert "but it was suspected" in again and "x looks off by 3 mm" in sensor


def test_a_sensor_that_was_in_error_for_a_while_is_told() -> None:
    frozen = {"cause": "frozen", "onset": 30, "end": 90}
    events = [
        Event(38, 0, "measurement_error", "x", "frozen while the model predicts motion", frozen),
        Event(91, 0, "measurement_restored", "x", "no longer frozen", frozen),
    ]
    short = {**frozen, "onset": 95, "end": 99}
    more = [replace(one, row=one.row + 60, evidence=short) for one in events]
    with Twin(ROBOT) as twin:
        once, twice = (
            headline(twin.setup, figures(0.004, 0.004), (twin.champion,), some, None)
            for some in (events, events + more)
        )
    said = "from row 30 to 90: frozen while the model predicts motion; nothing was learned from it."
    assert once.endswith(f"x was in error {said}") and "contradicted" not in once
    assert twice.endswith(f"x was in error 2 times, longest {said}")


def test_a_clear_step_that_was_believed_is_told_whatever_the_rows() -> None:
    """Among 10,000 rows, and less than predictions were off by once."""
    with Twin(ROBOT) as twin:
        one = {"x": replace(figures(0.1, 0.1)["x"], most=0.6)}
        told = [
            headline(twin.setup, one, (twin.champion,), [stepped(67, by)], None, 10_000)
            for by in (0.5, 0.2)
        ]
    assert "pose stepped x +50 cm away from the model at row 60 and was believed" in told[0]
    assert "pose" not in told[1]


def test_what_did_not_move_is_not_called_fitting() -> None:
    still = {n: replace(f, judged=float("nan")) for n, f in figures(0.03, 0.03).items()}
    with Twin(ROBOT) as twin:
        assert "Nothing moved, so whether the twin fits cannot be told" in headline(
            twin.setup, still, (twin.champion,), [], None
        )


def test_without_a_requirement_it_asks_for_one() -> None:
    text = said(replace(ROBOT, anomaly=AnomalySpec()), 0.03, 0.03)
    assert "no requirement is set" in text and "[anomaly] requirement" in text


def test_contradictions_of_a_sensor_are_counted() -> None:
    text = said(ROBOT, 0.004, 0.004, "overruled", "measurement_error", "external")
    assert "contradicted each other at x (2×)" in text and "acted on the machine 1 time" in text


def test_a_place_at_which_contacts_come_again_is_named() -> None:
    with Twin(ROBOT) as twin:
        events = [Event(9, 0, "recurring", "x", "what moves x came 4 times", {})]
        text = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), events, None)
    assert text.endswith("What moves x came 4 times.")


@pytest.mark.parametrize(
    ("gain", "told"),
    [(0.94, "94 % less deviation so far"), (0.0, "no better so far"), (-6.46, "worse so")],
)
def test_a_trial_is_called_better_only_where_it_is(gain: float, told: str) -> None:
    trial = OpenTrial(1, "tuned gain", 5, 7, gain, 0.67, (), None, None, "the gain is below 5 %")
    text = said(ROBOT, 0.03, 0.03, "suspected", trial=trial)
    assert told in text and ("a better version" in text) == (gain > 0.1)


def test_a_long_list_is_cut_behind_its_first_names_and_causes_stay() -> None:
    names = ", ".join(f"Fc{k}" for k in range(34))
    text = said(ROBOT, 0.029, 0.004, "promoted", version=1, reason=f"tuned {names}; joint1 sticks")
    assert "Changed: tuned 34 numbers (Fc0, Fc1, Fc2 …); joint1 sticks." in text


def test_many_outputs_are_told_as_a_range() -> None:
    with Twin(ROBOT) as twin:
        many = {f"tau{k}": OutputFigures("Nm", 1.0, 1.0, s, s, s, s, 9, 9) for k, s in enumerate(
            (0.6, 0.8, 0.9, 1.0), start=1)}  # fmt: skip
        text = headline(twin.setup, many, (twin.champion,), [], None)
    assert "tau1 … tau4 are off by 60 to 100 % of their size" in text


def test_channels_without_terms_are_refused() -> None:
    text = 'schema = 1\nname = "r"\nmodel = { kind = "robot1d" }\ncorrection = { channels = ["v"] }'
    with pytest.raises(UsageError, match="kinds that may be tried"):
        reads(text)
    assert reads(text.replace('["v"]', '["v"], terms = []')).correction.terms == ()


def test_sizes_as_a_person_says_them() -> None:
    assert spoken(0.00012, "m") == "0.12 mm" and spoken(250.0, "N") == "250 N"
    assert both(1.2, 0.04, "m") == ("1.2 m", "0.04 m") and spoken(np.nan, "m") == "unknown"
    assert spoken(0.5, "1") == "0.5"


def test_contacts_that_were_the_machines_own_are_not_counted() -> None:
    def event(row: int, kind: str, first: int) -> Event:
        return Event(row, 0, kind, "x", "it is the machine's own", {"first": first})

    told = [event(50, "external", 40), event(90, "external", 80), event(99, "recurring", 70)]
    with Twin(ROBOT) as twin:
        one = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), told, None)
        three = [*told, event(150, "external", 140), event(160, "external", 150)]
        more = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), three, None)
    assert "acted on the machine 1 time;" in one and one.endswith("It is the machine's own.")
    assert "acted on the machine 3 times;" in more


def test_of_what_moves_the_rows_that_move_are_told() -> None:
    some = {
        "x": replace(figures(0.030, 0.020)["x"], rms_moving_before=0.029, rms_moving_after=0.004)
    }
    with Twin(replace(ROBOT, moving=MovingSpec(channels={"x": "v"}, above=0.01))) as twin:
        champion = replace(twin.champion, number=1, reason="tuned gain")
        text = headline(twin.setup, some, (champion,), [], None)
    assert "4 mm instead of 29 mm (rms while it moves, predicted 1 s ahead)" in text


def test_a_load_is_told_and_what_seemed_to_act_meanwhile_is_not() -> None:
    told = [
        Event(20, 0, "suspected", "x", "off", {}),
        Event(30, 0, "external", "x", "", {"first": 12}),
        Event(40, 0, "recurring", "x", "it is the machine's own", {"first": 8}),
        Event(50, 0, "state", "load", "carries 2 kg since row 10", {"version": 1, "row": 10}),
    ]
    with Twin(ROBOT) as twin:
        text = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), told, None)
    assert text.startswith("The twin fits its machine, and nothing else was changed")
    assert text.endswith("Carries 2 kg since row 10.")


def test_what_no_limit_is_asked_of_is_named() -> None:
    some = figures(0.004, 0.004) | {"heading": replace(figures(0.1, 0.1)["x"], judged=np.nan)}
    with Twin(ROBOT) as twin:
        text = headline(twin.setup, some, (twin.champion,), [], None)
    assert text.endswith("No limit is asked of heading.")


def stepped(row: int, x: float) -> Event:
    known = {"onset": row - 7, "delta": {"x": x, "y": 0.002}, "sigma": {"x": 0.006, "y": 0.006}}
    return Event(row, 0, "overruled", "pose", "8 samples agree with each other", known)


@pytest.mark.parametrize(
    ("steps", "first"),
    [
        ([(67, 0.5)], "pose has stood x +50 cm apart from what the model followed since row 60:"),
        ([(67, 0.5), (97, -0.49)], "pose stood x +50 cm apart from row 60 to 90 and came back:"),
        ([(67, 0.5), (97, -0.2)], "pose has stood x −20 cm apart from what the model followed"),
        ([(67, 0.02)], "The twin fits its machine"),  # within the sensor's noise
        ([(67 + 9 * k, 0.5) for k in range(4)], "The twin fits its machine"),  # the model is rough
    ],
)
def test_a_sensor_that_stepped_away_is_told_first(
    steps: list[tuple[int, float]], first: str
) -> None:
    events = [stepped(row, x) for row, x in steps]
    with Twin(ROBOT) as twin:
        text = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), events, None)
    assert text.startswith(first)
    assert ("is off since then, or was before and came right" in text) is ("has stood" in first)
    assert ("contradicted each other at pose" in text) is first.startswith("The twin")


def test_why_nothing_was_predicted() -> None:
    with Twin(ROBOT) as twin:
        told = [
            headline(twin.setup, figures(np.nan, np.nan), (twin.champion,), [], None, rows)
            for rows in (0, 5, 5000)
        ]
    assert "no output has a measurement" in told[0]
    assert "5 rows are too few" in told[1] and "no row has all its inputs" in told[2]


def test_rows_that_were_lost_are_told_first() -> None:
    tally = Tally("log", used=1)
    for line in range(2, 12):
        tally.add([Problem("backward", line, "a step of -0.005 s")], "run.csv")
    assert first_of_rows("Nothing.", [tally]).startswith(
        "10 of 11 rows of log were left out: 10 backward, run.csv line 2: a step of -0.005 s. Not"
    )
    tally.suspect("the stamps fall in 9 of 9 steps: sort the rows by time")
    assert "were left out: the stamps fall in 9 of 9 steps" in first_of_rows("", [tally])
    tally.used = 20
    assert first_of_rows("Fine.", [tally]) == "Fine."


def test_what_overruled_a_model_before_it_was_replaced_is_not_told() -> None:
    events = [stepped(67, 0.5), Event(80, 0, "promoted", "", "tuned gain", {})]
    with Twin(ROBOT) as twin:
        text = headline(twin.setup, figures(0.004, 0.004), (twin.champion,), events, None)
    assert "pose has stood" not in text


def test_a_jump_within_what_the_model_is_off_by_is_not_the_sensors() -> None:
    with Twin(ROBOT) as twin:
        rough, true = (
            headline(twin.setup, figures(rms, rms), (twin.champion,), [stepped(67, 0.5)], None)
            for rms in (0.3, 0.1)
        )
    assert "pose has stood" not in rough and "pose has stood" in true


def test_a_jump_as_far_as_predictions_were_off_elsewhere_is_not_the_sensors() -> None:
    """A command that comes a row late moves a heading by as much, once in a while."""
    events, rows = [stepped(67, 0.5)], np.arange(200)
    off = np.where(rows == 20, 0.6, 0.01) + 2.0 * (rows == 67)
    trace = {"row": rows, "t": rows * 0, "off": off[:, None],
             "mark": np.zeros((200, 1), dtype=np.uint8)}  # fmt: skip
    found = usual_most(trace, events, 0.1)
    assert found is not None and found.tolist() == [0.6]
    with Twin(ROBOT) as twin:
        few, many = (
            headline(twin.setup, {"x": replace(figures(0.1, 0.1)["x"], most=most)},
                     (twin.champion,), events, None)
            for most in (float(found[0]), 0.3)
        )  # fmt: skip
    assert "pose has stood" not in few and "pose has stood" in many


def test_single_contradictions_of_a_rough_model_are_not_told() -> None:
    def text(count: int, cause: str) -> str:
        events = [
            Event(10 * k, 0, "measurement_error", "x", "", {"cause": cause}) for k in range(count)
        ]
        with Twin(ROBOT) as twin:
            return headline(
                twin.setup, figures(0.004, 0.004), (twin.champion,), events, None, measured=10_000
            )

    assert "contradicted" not in text(20, "vote") and "x (40×)" in text(40, "vote")
    assert "x (1×)" in text(1, "frozen")


@pytest.mark.parametrize(("first", "last", "version"), [(0.004, 0.004, 0), (0.029, 0.004, 1)])
def test_a_twin_whose_rows_are_refused_to_the_end_is_not_called_fitting(
    first: float, last: float, version: int
) -> None:
    factor = {"cause": "factor", "onset": 3, "end": 9}
    restored = Event(20, 0, "measurement_restored", "pose", "no longer off", factor)
    fault = Event(9, 0, "measurement_error", "pose", "off by a factor of 100", factor)
    with Twin(ROBOT) as twin:
        champion = replace(twin.champion, number=version, reason="tuned gain")
        group = twin.setup.model.outputs.channels[0].group
        events = [replace(one, signal=group) for one in (fault, restored)]
        told, over = (
            headline(twin.setup, figures(first, last), (champion,), some, None)
            for some in (events[:1], events)
        )
    assert "believed it is within what is asked" in told and "fits its machine" not in told
    assert "The twin fits its machine" in over


def test_what_was_changed_counts_from_the_version_before() -> None:
    with Twin(ROBOT) as twin:
        before = replace(twin.champion, number=1, values=(0.9,), reason="tuned gain")
        live = replace(before, number=2, values=(0.7,))
        events = [Event(5, 0, "promoted", "", "", {"version": 2})]
        text = headline(twin.setup, figures(0.029, 0.004), (live, before), events, None)
    assert text.endswith("Changed by itself: gain 0.9 → 0.7.")


def test_a_fault_that_was_over_for_a_moment_began_when_it_began() -> None:
    def told(kind: str, row: int, onset: int) -> Event:
        evidence = {"cause": "factor", "onset": onset, "end": row}
        return Event(row, 0, kind, "current", "off by a factor of 1000", evidence)

    events = [
        told("measurement_error", 7, 0), told("measurement_restored", 1143, 1143),
        told("measurement_error", 1151, 1150), told("measurement_restored", 1152, 1152),
        told("measurement_error", 1160, 1153),
    ]  # fmt: skip
    assert "since row 0" in open_faults(events)["current"]
    later = [*events[:2], told("measurement_error", 9000, 8990)]
    assert "since row 8990" in open_faults(later)["current"]


def test_what_two_signals_say_of_each_other_is_not_over_because_one_of_them_looks_sound() -> None:
    compared = {"cause": "kinematics", "first": 4500, "open": True}
    alone = {"cause": "range", "onset": 4660, "end": 4668}
    events = [
        Event(4600, 0, "measurement_error", "q2", "q2 is 57.3 times what qd2 says", compared),
        Event(4661, 0, "measurement_error", "q2", "13.6 rad is impossible", alone),
        Event(4668, 0, "measurement_restored", "q2", "6.176 rad is believed again", alone),
    ]
    said = "q2 has been in error since row 4500: q2 is 57.3 times what qd2 says."
    assert open_faults(events) == {"q2": said}
    over = Event(5000, 0, "measurement_restored", "q2", "agrees again", compared | {"open": False})
    assert not open_faults([*events, over])


def test_a_deviation_is_told_in_the_unit_that_the_twin_file_records_it_in() -> None:
    spec = replace(
        ROBOT, source=(SourceSpec("log", channels={"x": ChannelSpec("pos", unit="ft")}),),
    )  # fmt: skip
    with Twin(spec) as twin:
        assert twin.setup.recorded[twin.setup.model.outputs.names.index("x")] == "ft"
        assert twin.setup.shown(0, 0.3048) == "1 ft"
        one = replace(figures(0.3048, 0.3048)["x"], recorded="ft")
        text = headline(twin.setup, {"x": one}, (twin.champion,), [], None)
    assert "x is off by 1 ft" in text and "where 0.033 ft is asked" in text
    assert spoken(1.5, "rad/s", "rad/s") == "1.5 rad/s"
