"""Is the recording sound? Clocks, gaps, frozen and absurd channels, rows that are lost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.fold import Block, Event, Mark, take
from evertwin.gauges.rows.unlike import changes
from evertwin.signals import wrap
from evertwin.signals.spoken import spoken
from evertwin.sources.clocks.tally import Tally
from evertwin.sync.horizon.horizon import residuals

LOST = 0.05
"""Share of an output's samples that may go unused."""
SOON = 20
"""Rows behind a run of near values that tell whether the sensor lives."""
DIGITS = 10.0
"""Last digits by which what is called frozen is predicted to move, at least."""
NAMED = 3
"""Events of one signal that are named one by one."""

_CLOCK = {
    "repeated": "the second row of each is dropped; look at the logger",
    "backward": "these rows are dropped: sort the recording, or split it where the clock restarts",
    "clock_jump": "single rows with an absurd stamp are dropped: check that nothing real is lost",
    "clock_set": "the clock was set while recording: intervals are kept, absolute times are not",
    "gap": "predictions start anew behind a gap: set [clock] gap to the longest that may be "
    "simulated over",
    "no_stamp": "rows without a stamp are dropped: check the column of time",
}
_OWN = ("absurd", "gap")
_ROWS = "the row or cell is left out: look at this line of the file (evertwin info)"


def look_data(view: View) -> Iterator[Finding]:
    """What sources and arbiter found, and how much is lost to it."""
    for tally in view.tallies:
        yield from _sound(tally)
    yield from _not_finite(view)
    yield from _frozen_inputs(view)
    yield from _frozen_outputs(view)
    yield from _faults(view)
    if view.failed:
        yield Finding(
            "model_failed", "model", str(view.failed), "all rows",
            "these rows are left out: let the step give numbers there, or cut them from the data",
            view.failed.to_dict(),
        )  # fmt: skip
    yield from _lost(view)


def _sound(tally: Tally) -> Iterator[Finding]:
    """What was wrong with the rows of one source."""
    lost = {"left_out": tally.left_out, "used": tally.used}
    step = "correct the twin file, or the recording"
    for suspicion in tally.suspicions:
        yield Finding("clock", tally.source, suspicion, "all rows", step, lost)
    for kind, line in zip(sorted(tally.counts), tally.lines(), strict=True):
        problem, count = tally.first[kind][0], {"count": tally.counts[kind]}
        name = kind if kind in _OWN else "clock" if kind in _CLOCK else "missing"
        where = f"{problem.file} line {problem.line} first"
        yield Finding(name, kind, line, where, _CLOCK.get(kind, _ROWS), count)


def _not_finite(view: View) -> Iterator[Finding]:
    """Inputs that are not known, and outputs that are infinite."""
    u = np.concatenate([window.u for window in view.windows])
    y = np.concatenate([window.y for window in view.windows])
    mark, nu = np.concatenate([window.mark for window in view.windows]), u.shape[1]
    for k, name in enumerate(view.model.inputs.names):
        if bad := int(np.count_nonzero(~np.isfinite(u[:, k]))):
            first = int(np.flatnonzero(~np.isfinite(u[:, k]))[0])
            yield Finding(
                "missing", name, f"input {name} is not known in {bad} of {len(u)} rows",
                f"row {first} first",
                "nothing is predicted there: fill it in the recording, or give sentinels that "
                "stand for no value", {"rows": bad},
            )  # fmt: skip
    for k, name in enumerate(view.model.outputs.names):
        absurd = mark[:, nu + k] == Mark.ERROR
        if bad := int(np.count_nonzero(absurd)):
            first = int(np.flatnonzero(absurd)[0])
            yield Finding(
                "absurd", name, f"{name} is infinite in {bad} of {len(y)} rows",
                f"row {first} first", "marked as errors; look at the recording there",
                {"rows": bad},
            )  # fmt: skip
        if len(y) and np.isnan(y[:, k]).all():
            yield Finding(
                "missing", name, f"{name} was never measured", "all rows",
                f"check the column of {name} in [source.channels]", {},
            )  # fmt: skip


def _frozen_inputs(view: View) -> Iterator[Finding]:
    """A measured input of a static map that stands still while its rate says that it moves."""
    if not view.setup.static:
        return
    longest = max(view.windows, key=lambda window: len(window.t))
    for k, channel in enumerate(view.model.inputs):
        values = longest.u[:, k]
        run, start = _longest_run(values)
        changing = len(np.unique(values[np.isfinite(values)]))
        if changing > 0.2 * len(values) and run > max(20, 0.05 * len(values)):
            others = np.delete(longest.u[start : start + run], k, axis=1)
            if (np.nanstd(others, axis=0) > 0.2 * np.nanstd(longest.u, axis=0).max()).any():
                yield Finding(
                    "frozen", channel.name,
                    f"input {channel.name} stands still for {run} rows while others move",
                    f"rows {longest.row + start} to {longest.row + start + run - 1}",
                    "leave this stretch out ([clock] start, stop) or repair the sensor",
                    {"rows": run},
                )  # fmt: skip


def _frozen_outputs(view: View) -> Iterator[Finding]:
    """An output of a model with states that stays what it is, to the last digit, while the inputs
    are predicted to move it: by far more than its digits, or than is asked where it has none."""
    if view.setup.static:
        return
    for k, channel in enumerate(view.model.outputs):
        pieces = [_alike(window, k) for window in view.windows]
        piece, count = max(pieces, key=lambda one: one[1])
        known = [window.y[np.isfinite(window.y[:, k]), k] for window in view.windows]
        if count < max(SOON, LOST * sum(map(len, known))):
            continue
        steps = np.abs(np.concatenate([np.diff(one) for one in known]))
        digit = float(np.min(steps, where=steps > 0.0, initial=np.inf))
        asked = 0.0 if view.setup.relative or not view.setup.decides else view.setup.requirement
        moved = _driven(view, take(piece, 0, min(len(piece.t), view.most)), k)
        if moved > (DIGITS * digit if np.isfinite(digit) else asked):
            last = piece.row + len(piece.t) - 1
            yield Finding(
                "frozen", channel.name,
                f"{channel.name} stays the same, to the last digit, in {count} samples, while what "
                f"the inputs do is predicted to move it by {spoken(moved, channel.unit)} (rms)",
                f"rows {piece.row} to {last}",
                "its sensor does not answer, or the machine was held: repair the sensor, or leave "
                "this stretch out ([clock] start, stop)", {"rows": count, "moved": moved},
            )  # fmt: skip


def _alike(window: Block, k: int) -> tuple[Block, int]:
    """The longest stretch in which output ``k`` stays the same, without a gap, and its samples."""
    known = np.flatnonzero(np.isfinite(window.y[:, k]))
    if not len(known):
        return take(window, 0, 0), 0
    parts = np.cumsum(window.gap)[known]  # a gap begins a stretch of its own
    begins = np.flatnonzero((np.diff(window.y[known, k]) != 0.0) | (np.diff(parts) != 0)) + 1
    edges = np.concatenate([[0], begins, [len(known)]])
    at = int(np.argmax(np.diff(edges)))
    count = int(edges[at + 1] - edges[at])
    return take(window, int(known[edges[at]]), int(known[edges[at + 1] - 1]) + 1), count


def _driven(view: View, piece: Block, k: int) -> float:
    """Rms by which output ``k`` is predicted to move because the inputs do not stay what they
    are."""
    model, p = view.model, view.version.p
    x0 = model.observe(model.initial(p), piece.y[0])
    held = np.broadcast_to(piece.u[:1], piece.u.shape).copy()
    moved, still = (model.simulate(x0, u, piece.dt, p)[1][:, k] for u in (piece.u, held))
    gone = wrap((moved - still)[:, None], model.outputs.angles[k : k + 1])[:, 0]
    gone = gone[np.isfinite(gone)]
    return float(np.sqrt(np.mean(np.square(gone)))) if len(gone) else 0.0


def _longest_run(values: np.ndarray) -> tuple[int, int]:
    """Length and start of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(values) != 0) + 1
    starts = np.concatenate([[0], edges])
    lengths = np.diff(np.concatenate([starts, [len(values)]]))
    at = int(np.argmax(lengths))
    return int(lengths[at]), int(starts[at])


def _faults(view: View) -> Iterator[Finding]:
    """What the arbiter marked."""
    signals: dict[str, list[int]] = {}
    stood = _stood(view)
    for number, event in enumerate(view.events):
        wrong = event.kind in ("measurement_error", "overruled") and number not in stood
        if wrong and not _model_is_off(view, event):
            signals.setdefault(event.signal, []).append(number)
    gated = [event for event in view.events if _model_is_off(view, event)]
    if gated:
        names = ", ".join(sorted({event.signal for event in gated}))
        yield Finding(
            "gate", gated[0].signal,
            f"the model is off by more than the gate {len(gated)} times, on {names}",
            f"row {gated[0].row} first",
            "a wider [arbiter] gate until the model is tuned: contested samples are not tuned on",
            {"events": len(gated)},
        )  # fmt: skip
    for signal, numbers in signals.items():
        for number in numbers[:NAMED]:
            event = view.events[number]
            frozen = event.evidence.get("cause") == "frozen"
            jumped = event.kind == "overruled"
            yield Finding(
                "frozen" if frozen else "jump" if jumped else "absurd", signal,
                f"{signal}: {event.reason}", f"row {event.evidence.get('onset', event.row)}",
                "the model was overruled: a real displacement, or a sensor that was set; check"
                if jumped
                else "these samples are left out; repair the sensor or check its unit",
                event.evidence,
            )  # fmt: skip
        if len(numbers) > NAMED:
            yield Finding(
                "absurd", signal, f"{signal}: {len(numbers) - NAMED} further events of this kind",
                f"row {view.events[numbers[NAMED]].row} and on",
                "run the twin and read its events", {"events": len(numbers)},
            )  # fmt: skip


def _stood(view: View) -> set[int]:
    """Numbers of the events by which a machine that stood, against the model, was called frozen;
    what follows at once, its return to the prediction, goes with them."""
    found, until = set[int](), dict[str, int]()
    for number, event in enumerate(view.events):
        about: Any = event.evidence
        if event.kind not in ("measurement_error", "overruled") or "onset" not in about:
            continue
        goes_on = about.get("cause") == "frozen" and _goes_on(view, event)
        if goes_on or until.get(event.signal) == about["onset"] - 1:
            found.add(number)
            until[event.signal] = about.get("end", event.row)
    return found


def _goes_on(view: View, event: Event) -> bool:
    """Did the sensor live? Behind near values it soon scatters more, behind equal ones it gives
    others; and the first is a step of it away, or nearer to the run than to the prediction."""
    about: Any = event.evidence
    layout = view.model.outputs
    window = next((w for w in view.windows if 0 <= about["onset"] - w.row < len(w.t)), None)
    if window is None or "end" not in about or event.signal not in about.get("delta", {}):
        return False
    k, first, end = layout.index(event.signal), about["onset"] - window.row, about["end"] + 1
    gone = wrap(window.y[first:, k : k + 1] - window.y[first, k], layout.angles[k : k + 1])[:, 0]
    count = end - window.row - first
    run, behind = (part[np.isfinite(part)] for part in (gone[:count], gone[count:]))
    if not (len(run) and len(behind)):
        return False
    usual = float(np.median(np.abs(run)))  # 0 of equal values
    if usual > 0:
        behind = behind[:SOON]
        others = behind[np.abs(behind) > usual]
        if not np.median(np.abs(behind)) > 1.5 * usual:
            return False
    else:
        others = behind[~np.isin(behind, run)]
    if not len(others):
        return False
    steps = np.abs(np.diff(gone[np.isfinite(gone)]))
    near = 1.5 * float(np.min(steps, where=steps > 1e-9 * steps.max(), initial=np.inf))
    nearer = abs(others[0]) < 0.5 * abs(others[0] - about["delta"][event.signal])
    return bool(nearer or abs(others[0]) <= near)


def _model_is_off(view: View, event: Event) -> bool:
    """A static map has no place to jump from: what its gate contests is the model's own error. So
    is a factor that is one of a model that is far off anyway."""
    cause = event.evidence.get("cause")
    contested = event.kind == "overruled" or cause == "vote"
    contested |= cause == "factor" and event.signal in view.astray
    return view.setup.static and contested


def _lost(view: View) -> Iterator[Finding]:
    """Samples that were measured and are not used."""
    known = []
    for judged in view.simulated:
        predicted = changes(view.model, view.version.p, judged, view.horizon).predicted
        zero = np.where(np.isnan(predicted), np.nan, 0.0)
        known.append(~np.isnan(residuals(view.model, judged, zero)))
    marks = [raw.mark[: len(one)] for raw, one in zip(view.windows, known, strict=False)]
    for k, name in enumerate(view.model.outputs.names):
        there = (one[:, view.windows[0].u.shape[1] + k] != Mark.ABSENT for one in marks)
        measured = sum(int(np.count_nonzero(one)) for one in there)
        used = sum(int(np.count_nonzero(one[:, k])) for one in known)
        if measured and 1 - used / measured > LOST:
            yield Finding(
                "lost", name,
                f"{measured - used} of {measured} samples of {name} are not used "
                f"({100 * (1 - used / measured):.1f} %)",
                "all rows", "too many gaps, unknown inputs or marked samples: see the other "
                "findings, or widen [arbiter] gate where the model is far off",
                {"measured": measured, "used": used},
            )  # fmt: skip
