"""What came of a run, as one would tell a colleague: the first lines of every result.

Better, unchanged, on trial, not judged, or off with nothing better found: each case says so, with
the deviation in a person's units, how far ahead it is predicted, and what to do next.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evertwin.fold import Event
from evertwin.gauges.changes.unseen_inputs import OUTSIDE
from evertwin.models.form import Version
from evertwin.models.functions.failures import Failed
from evertwin.outcome.course.changes import changes
from evertwin.outcome.course.contradicted import contradicted
from evertwin.outcome.course.jumps import believed, forgotten, jumps
from evertwin.outcome.course.lives import restless, returned, went_back
from evertwin.outcome.open.faults import open_faults
from evertwin.outcome.open.nothing_better import CLEAR, nothing_better, of_a_sensor, two_clocks
from evertwin.outcome.open.on_trial import OpenTrial, shorter
from evertwin.outcome.open.unjudged import none_judged
from evertwin.outcome.open.unperceived import unperceived
from evertwin.outcome.result import OutputFigures
from evertwin.rows.ring import called
from evertwin.setup.setup import Setup
from evertwin.signals.spoken import both, share, spoken
from evertwin.sources.clocks.tally import Tally

FEW = 3
"""Outputs that are named one by one."""
SHORT, FEWER = 30, 10
"""Rows since a version went live below which they do not tell how good it is; predictions, where
each counts once, at its horizon."""
LOST = 0.5
"""Share of the rows left out from which on this is said first."""
OFTEN = 10
"""Contacts in a run from which on it is said that they may be none."""
NEWEST = 2
"""Windows of a deviation before the end in which one that is told goes on."""
ROUGH = 3.0
"""A jump of fewer times what the model is off by is no news of its sensor."""
LATEST = ("state", "followed", "alternates", "pose_late")
"""Kinds of event of which the newest is told."""
FITS = re.compile("The twin fits its machine(?: now)?")
"""What is said of a twin, unless rows of an output are refused to the end."""


def headline(
    setup: Setup, outputs: Mapping[str, OutputFigures], versions: tuple[Version, ...],
    events: Sequence[Event], trial: OpenTrial | None, measured: int = 0,
) -> str:  # fmt: skip
    """The outcome in a sentence or a few; ``versions``: the live one, and those that were live
    before it, the newest first; ``measured``: rows that measure an output."""
    champion = versions[0]
    known = {name: f for name, f in outputs.items() if not math.isnan(f.rms_after)}
    doubted, refused = of_a_sensor(events), open_faults(events)
    faults = wrong(setup, outputs, events)
    if known:
        outcome = _outcome(setup, known, versions, events, trial, measured)
        if refused.keys() & {one.group for one in setup.model.outputs}:
            outcome = FITS.sub("On the rows that were believed it is within what is asked", outcome)
    elif champion.number:
        outcome = (
            f"Version {champion.number} is live ({shorter(champion.reason)}); no row since then "
            "tells how much better it is."
        )
    else:
        outcome = none_judged(setup, measured, SHORT)
    turns = [{e.evidence["first"], e.evidence["second"]} for e in _last(events, "alternates")]
    back = () if {champion.number} <= set().union(*turns) else went_back(events, champion.number)
    told = [*faults.values(), *unperceived(events), outcome, *restless(setup, events), *back]
    if doubted and doubted not in outcome:  # of a sensor in front; the machine may be elsewhere
        place = len(told) if doubted.startswith(OUTSIDE) else 0
        told.insert(place, f"{doubted[0].upper()}{doubted[1:]}.")
    told += map(_sentence, [one for kind in LATEST for one in _last(events, kind)])
    steps = _stepped(setup, outputs, events)[1]
    told += [said for signal, said in steps.items() if signal not in faults]
    told += contradicted(events, {**steps, **faults}, _end(events, measured))
    contacts, own = _contacts(events)
    if contacts:
        times = f"{contacts} time{'s' * (contacts > 1)}"
        told.append(f"Something outside acted on the machine {times}; it was not learned.")
    if contacts >= OFTEN:
        told.append(
            "So often it may be the machine's own ([anomaly] external = 0 lets it be tuned)."
        )
    told += map(_sentence, own[-1:])
    return " ".join(told)


def wrong(
    setup: Setup, outputs: Mapping[str, OutputFigures], events: Sequence[Event]
) -> Mapping[str, str]:
    """Signals that stepped away from the model and did not come back, or whose measurement is in
    error, each with the sentence about it."""
    return {**_stepped(setup, outputs, events)[0], **open_faults(events)}


def _stepped(
    setup: Setup, outputs: Mapping[str, OutputFigures], events: Sequence[Event]
) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Signals that stepped away from the model farther than it ever was off elsewhere; and those
    that did so by more than it usually is."""
    told_in = zip(setup.model.outputs.units, setup.recorded, strict=True)
    units = dict(zip(setup.model.outputs.names, told_in, strict=True))
    asked = 0.0 if setup.relative or not setup.decides else setup.requirement
    usual = {
        name: max(asked, ROUGH * f.rms_after)
        for name, f in outputs.items() if not math.isnan(f.rms_after)
    }  # fmt: skip
    least = {name: max(size, np.nan_to_num(outputs[name].most)) for name, size in usual.items()}
    # of a channel that is read wrongly, the others step away from the model as well
    late = two_clocks(setup, events) and not setup.spec.correction.terms
    if setup.static or of_a_sensor(events) or late:
        return {}, {}
    stepped = jumps(events, units, least)
    if stepped:  # simulated only where it matters
        gone = forgotten(setup.model, setup.model.parameters.values, setup.horizon)
        stepped = jumps(events, units, least, gone)
    return stepped, believed(events, units, usual)


def also_pinned(told: str, version: int, *, pinned: bool) -> str:
    """``told``, and that no other version goes live, where the live one is pinned.

    >>> also_pinned("It fits.", 3, pinned=True)
    'It fits. Version 3 is pinned: nothing else is tuned or goes live until it is unpinned.'
    """
    said = f" Version {version} is pinned: nothing else is tuned or goes live until it is unpinned."
    return told + said * pinned


def unless_at_rest(told: str, *, still: bool) -> str:
    """``told``, unless a twin is said to fit by rows at which nothing moved.

    >>> unless_at_rest("The twin fits its machine, and nothing was changed.", still=True)
    'Nothing moved, so whether the twin fits cannot be told, and nothing was changed.'
    """
    said = "Nothing moved, so whether the twin fits cannot be told"
    return FITS.sub(said, told) if still else told


def failed_first(told: str, failed: Failed | None) -> str:
    """``told``, after what the model could not compute; in its place, where that is all."""
    if failed is None:
        return told
    said = f"{failed}"
    return (
        f"Nothing was predicted: {said}."
        if failed.all
        else (f"{said[0].upper()}{said[1:]}: these rows are left out. {told}")
    )


def first_of_rows(told: str, left_out: Sequence[Tally]) -> str:
    """``told``, after what became of most rows of a source, where most were left out, or after
    what may be wrong with all of them."""
    for tally in left_out:
        why, who = "; ".join(tally.suspicions or tally.lines()[:1]), tally.source or "the data"
        if tally.share > LOST:
            rows = f"{tally.left_out} of {tally.left_out + tally.used} rows"
            return f"{rows} of {who} were left out: {why}. {told}"
        if tally.doubt:
            return f"Look at {who} first: {tally.doubt}. {told}"
    return told


def _end(events: Sequence[Event], measured: int) -> int:
    """Rows that came, as far as is known."""
    return max(measured, events[-1].row if events else 0)


def _sentence(event: Event) -> str:
    return f"{event.reason[0].upper()}{event.reason[1:]}."


def _last(events: Sequence[Event], kind: str) -> list[Event]:
    """The last event of a kind, if there is one."""
    return [e for e in events if e.kind == kind][-1:]


def _contacts(events: Sequence[Event]) -> tuple[int, list[Event]]:
    """How often something outside acted, and what came again and again: without what turned out to
    be the machine's own, a load, or a unit."""
    found, own = list[float](), list[Event]()
    for event in events:
        known: Any = event.evidence
        if event.kind == "external":
            found.append(known.get("first", event.row))
        elif event.kind == "recurring":
            found = [one for one in found if one < known.get("first", math.inf)]
            own.append(event)
        elif event.kind == "state":
            found = [one for one in found if one < known["row"]]
            own = [one for one in own if one.row < known["row"]]
        elif event.kind == "abnormal" and "number" in known:
            return 0, []
    return len(found), own


def _outcome(
    setup: Setup, known: Mapping[str, OutputFigures], versions: tuple[Version, ...],
    events: Sequence[Event], trial: OpenTrial | None, measured: int,
) -> str:  # fmt: skip
    champion = versions[0]
    changed = {name: f for name, f in known.items() if f.after != f.before and f.before > 0}
    better = {n: f for n, f in changed.items() if f.after < (1.0 - CLEAR) * f.before}
    worse = {n: f for n, f in changed.items() if f.after > (1.0 + CLEAR) * f.before}
    why = _changed(setup, versions, events)
    rows = max(f.rows for f in known.values())
    one, short = ("prediction", FEWER) if setup.at_horizon.wanted else ("row", SHORT)
    if champion.number and changed and rows < short:
        return (
            f"{why}; {rows} {one}{'s' * (rows != 1)} since then are too few to tell how much "
            "better the twin is."
        )
    shares = setup.relative and setup.decides and len(known) <= FEW
    now, lead = _sizes(known, "off", shares=shares), _lead(setup)
    off = {n: f for n, f in known.items() if f.judged > setup.requirement}
    found = nothing_better(setup, events, trial, measured)
    still, asked = "", _asked(setup, known)
    if off:
        still = f" Still, {_off(setup, off)}, and {found}."
    elif again := _again(setup, versions[0], events, measured):
        still = f" Still, {again}, and {found}."
    if champion.number and better:
        less = f" ({_pairs(setup, worse)}: worse)" if worse else ""
        fits = "fits its machine now" if asked and not still else "is closer to its machine"
        return (
            f"The twin {fits}: {_pairs(setup, better)}{less}{lead}{asked if not off else ''}, "
            f"over rows that it had not seen. {why}.{still}"
        )
    if champion.number and changed:
        return (
            f"The live version is no better than the first on the rows since it came: "
            f"{_pairs(setup, worse or changed)}{lead}. {why}.{still}"
        )
    if not setup.decides:
        return (
            f"Nothing was judged, for no requirement is set: {now}{lead}. How far may it "
            "be off? Say so in [anomaly] requirement."
        )
    if off and all(f.spell for f in off.values()):
        return f"The twin fits its machine again: {_spells(off)}{lead}{asked}; {found}."
    if off:
        return f"The twin does not fit its machine: {_off(setup, off)}{lead}, and {found}."
    if math.isfinite(setup.requirement) and all(math.isnan(f.judged) for f in known.values()):
        lead = lead.replace(" while it moves", " at rest")
        why = "".join(f" {_sentence(event)}" for event in _last(events, "not_judged"))
        return f"Nothing moved, so whether the twin fits cannot be told: {now}{lead}.{why}"
    passed = trial is None and all(f.held for f in known.values()) and not of_a_sensor(events)
    until = _end(events, measured) - NEWEST * setup.enough if passed else -1
    return _calm(known, (versions[0], events, until), (now, lead, asked, found))


def _calm(
    known: Mapping[str, OutputFigures], seen: tuple[Version, Sequence[Event], int],
    said: tuple[str, str, str, str],
) -> str:  # fmt: skip
    """Of a version that is within what is asked over all rows: ``seen`` are it, the events, and the
    row until which all that was suspected has passed; ``said`` what it is off by, how far ahead,
    what is asked, and what was found."""
    (live, events, until), (now, lead, asked, found) = seen, said
    known_again = [one.row for one in (returned(events),) if one]
    named = max([*known_again, *(e.row for e in events if e.kind == "state")], default=-1)
    kinds = ("suspected", "drift", "abnormal")
    doubts = [e for e in events if e.kind in kinds and e.row > named]
    suspected = [e for e in doubts if e.kind != "abnormal"]
    times = f"suspected {len(suspected)} time{'s' * (len(suspected) != 1)}"
    within = doubts[-1].reason if doubts and "times" in doubts[-1].evidence else ""
    if within and doubts[-1].kind == "drift":
        return (
            f"The twin fits its machine, and nothing was changed: {now}{lead}{asked}. But {within}."
        )
    if not doubts or doubts[-1].row <= until:
        more = "nothing else" if named >= 0 or _last(events, "followed") else "nothing"
        free = [name for name, f in known.items() if math.isnan(f.judged)]
        rest = f" No limit is asked of {', '.join(free)}." if free else ""
        again = " again" if went_back(events, live.number) else f", and {more} was changed"
        rows = [called(e.row) for e in suspected[-1:]]
        passed = "".join(f" It was {times}, last at {row}, and has held since." for row in rows)
        return f"The twin fits its machine{again}: {now}{lead}{asked}.{rest}{passed}"
    last = next((e for e in reversed(doubts) if "step" in e.evidence), doubts[-1])
    why = f"{last.signal or last.kind}: {last.reason}"
    open_step = "step" in last.evidence and not all(f.held for f in known.values())
    lasts = ", which lasts" if open_step else ""
    why = f"it was {times} ({why}){lasts}, and " if suspected else f"{why}, and "
    return (
        f"Over all rows the twin is within what is asked: {now}{lead}{asked}; but "
        f"{why if last.reason != found else ''}{found}."
    )


def _again(setup: Setup, live: Version, events: Sequence[Event], measured: int) -> str:
    """What was suspected of the live version last, near the end of the rows; else nothing."""
    went = [e.row for e in events if e.evidence.get("version") == live.number]
    found = [e for e in events if went and e.kind == "suspected" and e.row > max(went)]
    if not found or _end(events, measured) - found[-1].row > NEWEST * setup.enough:
        return ""
    times = f"{len(found)} time{'s' * (len(found) > 1)}"
    return f"it was suspected {times} since, last at {called(found[-1].row)} ({found[-1].reason})"


def _off(setup: Setup, off: Mapping[str, OutputFigures]) -> str:
    """Which outputs are off by more than is asked, by how much, and what is asked."""
    sizes = _sizes(off, "off", shares=setup.relative and len(off) <= FEW)
    return f"{sizes} where {_limit(setup, off)} is asked"


def _said(f: OutputFigures, value: float) -> str:
    """A size of an output in the one unit that all of a headline's sizes of it are in."""
    return both(value, max(f.before, f.after), f.unit, f.recorded)[0]


def _spells(off: Mapping[str, OutputFigures]) -> str:
    """When outputs were off, by how much, and what they are off by on all other rows."""
    return ", ".join(
        f"{name} was off by {spoken(f.spell.inside, f.unit, f.recorded)} from row {f.spell.first} "
        f"to {f.spell.last}, and is by {spoken(f.spell.outside, f.unit, f.recorded)} on all others"
        for name, f in off.items()
        if f.spell
    )


def _limit(setup: Setup, judged: Mapping[str, OutputFigures]) -> str:
    """What is asked, in the unit of the outputs that are judged."""
    limit = setup.spec.anomaly.requirement
    if setup.relative:
        return f"{100 * limit:g} %"
    one = next(f for f in judged.values() if not math.isnan(f.judged))
    return _said(one, limit)


def _changed(setup: Setup, versions: tuple[Version, ...], events: Sequence[Event]) -> str:
    """What the newest promotion changed, from what, and by whom."""
    champion = versions[0]
    went = [
        e.evidence.get("person") or "itself" for e in events
        if e.kind == "promoted" and e.evidence.get("version") == champion.number
    ]  # fmt: skip
    by = f" by {went[-1]}" if went else ""
    return f"Changed{by}: {changes(setup, versions, events)}"


def _asked(setup: Setup, known: Mapping[str, OutputFigures]) -> str:
    """What is asked, behind what is reached."""
    if not math.isfinite(setup.requirement) or all(math.isnan(f.judged) for f in known.values()):
        return ""
    return f", where {_limit(setup, known)} is asked"


def _lead(setup: Setup) -> str:
    of = "rms" if setup.spec.moving is None else "rms while it moves"
    static = setup.static or not math.isfinite(setup.horizon)
    return f" ({of})" if static else f" ({of}, predicted {setup.horizon:g} s ahead)"


def _pairs(setup: Setup, some: Mapping[str, OutputFigures]) -> str:
    """Before and after, of a few outputs by name, of many as a range."""
    if len(some) > FEW:
        after, before = (
            _range([getattr(f, which) for f in some.values()])
            for which in ("relative_rms_moving_after", "relative_rms_moving_before")
        )
        return f"{_span(some)} are off by {after} of their size instead of {before}"
    told = []
    for name, f in some.items():
        first, last = both(f.before, f.after, f.unit, f.recorded)
        told.append(f"{name} is off by {last} instead of {first}")
    return ", ".join(told)


def _sizes(some: Mapping[str, OutputFigures], *off: str, shares: bool = False) -> str:
    """Sizes, with the words between a name and its size; ``shares``: as judged in % too."""
    if len(some) > FEW:
        most = _range([f.relative for f in some.values()])
        return " ".join((_span(some), *(f"are {word}" for word in off), f"by {most} of their size"))
    verb = "".join(f"is {word} " for word in off)
    return ", ".join(
        f"{name} {verb}by {_said(f, f.after)}"
        + f" ({share(f.judged)})" * (shares and not math.isnan(f.judged))
        for name, f in some.items()
    )


def _span(some: Mapping[str, OutputFigures]) -> str:
    names = list(some)
    return f"{names[0]} … {names[-1]}"


def _range(shares: Sequence[float]) -> str:
    low, high = (spoken(100 * bound(shares), "1") for bound in (min, max))
    return f"{low} %" if low == high else f"{low} to {high} %"
