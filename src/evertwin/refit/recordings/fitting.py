"""Fitting on recordings and judging on others: what ``evertwin fit`` does.

Nothing goes live here. Where the model has a ladder of friction laws, a rung is climbed, output by
output, only while the error on held-out tasks falls.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from evertwin.anomaly.verdict import branch
from evertwin.engine import Engine
from evertwin.errors import TooFew
from evertwin.fold import Block, Mark, Windows
from evertwin.gauges.units.read_otherwise import read_otherwise
from evertwin.gauges.units.turned import Numbered
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.functions.failures import Failed
from evertwin.refit.numbers.recursive_fit import Recursion
from evertwin.refit.recordings.fit_result import FitResult as FitResult
from evertwin.refit.recordings.fit_result import Held
from evertwin.refit.recordings.formed import Formed
from evertwin.refit.recordings.input_noise import drawn
from evertwin.refit.recordings.screening import Screened, screened
from evertwin.refit.recordings.term_search import Started, check_initials, own_start, with_terms
from evertwin.refit.work import Work
from evertwin.refit.workers import far_of
from evertwin.rows.feed import Data, Feed
from evertwin.setup.evaluation import (
    Prediction,
    as_required,
    deviations,
    falls_short,
    predict,
    seen_sizes,
)
from evertwin.setup.friction_law import Chosen, acting, climb_laws, inside, joined
from evertwin.setup.setup import Setup
from evertwin.setup.windows import starts, windows_of
from evertwin.sources.merging import Excerpt
from evertwin.tuning import (
    Fit,
    Problem,
    carried,
    moved,
    repeated,
    solve,
    started,
    told_apart,
)
from evertwin.tuning.form.blurred import Drawn, blurred
from evertwin.tuning.form.step_length import stepped
from evertwin.tuning.intervals.curvature import unbent
from evertwin.tuning.least_trimmed import trimmed
from evertwin.tuning.posing.hidden_starts import begun
from evertwin.tuning.search.interrupt import Interrupt
from evertwin.tuning.search.minima import lowest
from evertwin.tuning.tangent import leaning, searched, told
from evertwin.types import ParameterVector

SEEK = "[correction] channels, terms and in_fit = true seek what the form lacks"
LEFT = 10
"""Values beside as many as there are numbers, from which on what is left of them tells anything."""
Watch: TypeAlias = Callable[[int, float], bool]
"""Called with (evaluations so far, cost) while a search runs; False ends it, best so far kept."""


class Judged(NamedTuple):
    """Predictions of a recording's tasks, and what each begins with that nothing measures.

    >>> Judged([], []).begun
    []
    """

    predictions: list[Prediction]
    begun: list[dict[str, float]]


@dataclass(frozen=True)
class Tuned:
    """A version that was tuned on recordings, ready to predict others.

    >>> Tuned.__name__
    'Tuned'
    """

    setup: Setup
    base: Model
    trusted: ParameterVector
    """Of the version's own model, for what of a recording can be trusted."""
    formed: Formed
    chosen: Chosen
    unknown: str
    """Why no form that was tried is the machine's."""
    tasks: tuple[Block, ...]
    """What it was tuned on."""
    feed: Feed
    """What reads recordings, and counts what was wrong with them."""
    screened: Screened
    """These, and what of them is left out."""

    @property
    def model(self) -> Model:
        """The model in the form that was found."""
        return self.formed.problem.model

    def rows(self, data: Data) -> Screened:
        """The tasks of recordings, without what cannot be a measurement."""
        return screened(self.setup, self.base, self.trusted, self.feed.blocks(data))

    def judged(self, blocks: tuple[Block, ...], own: bool = True) -> Judged:
        """Predictions of tasks; ``own``: not learned from, so each finds the start it had."""
        setup, model, found = self.setup, self.model, self.formed.fit
        blocks = starts(setup, blocks)
        if own and setup.spec.tuning.method == "recursive":
            recursion = Recursion.after(setup, self.formed.problem, found)
            return Judged([recursion.predict(b) for b in blocks], [{} for _ in blocks])
        seen, said = list[Prediction](), list[dict[str, float]]()
        for k, block in enumerate(blocks):
            fit = own_start(setup, model, found.p, block) if own else Started.of(found)
            k, before = (0, ()) if own else (k, self.formed.problem.before)
            p = started(model, fit.p, fit.fitted, k)
            x0, told = begun(model, p, fit.fitted, k)
            seen.append(predict(setup, model, p, block, before, x0))
            said.append(told)
        return Judged(seen, said)


def tune(
    setup: Setup, versions: Versions, number: int, train: Data, watch: Watch | None = None,
    engine: Engine | None = None,
) -> Tuned:  # fmt: skip
    """Version ``number``, tuned on ``train``; differences in the engine's processes, if any.

    Raises:
        TooFew: too little can be used of it, and what was wrong with the rest.
    """
    feed = Feed(setup.spec, setup.model)
    try:
        return _tuned(setup, versions, number, (train, feed), watch, engine)
    except TooFew as error:
        raise TooFew(feed.why(str(error))) from error


def _tuned(
    setup: Setup, versions: Versions, number: int, data: tuple[Data, Feed], watch: Watch | None,
    engine: Engine | None,
) -> Tuned:  # fmt: skip
    (train, feed), version, base = data, versions[number], versions.model(number)
    problem, seen, trusted = posed(setup, versions, number, feed.several(train))
    tasks = seen.rows
    before, windows = led(setup, train, problem.windows)
    problem, tasks = replace(problem, before=before, windows=windows), windows if before else tasks
    far = None if engine is None else far_of(engine, setup.spec, version.form)
    problem = replace(problem, settings=replace(problem.settings, far=far))
    with Interrupt() as stop:
        problem, chosen = climb_laws(setup, _watched(problem, stop, watch))
        problem = lowest(searched(problem, inside(problem)))
        work = Work(setup, versions, before)
        formed = with_terms(setup, work, version, problem)
        inputs = drawn(setup, formed.problem.model, train, formed.problem.windows)
        fit = _sure(setup, formed, inputs)
        chosen = acting(chosen, problem, fit)
        unknown = _unknown(work, formed) if chosen.laws or formed.search else ""
        formed = replace(formed, fit=fit)
    return Tuned(setup, base, trusted, formed, chosen, unknown, tasks, feed, seen)


def _sure(setup: Setup, formed: Formed, inputs: Drawn | None) -> Fit:
    """The fit, with what is told apart and the intervals that hold all the same."""
    problem, fit = formed.problem, told_apart(formed.problem, formed.fit)
    within = inside(problem) if setup.spec.tuning.method != "recursive" else ()
    near = fit
    if within and fit.converged:  # what is held at zero, or put back, stays there
        pairs = zip(fit.values.tolist(), fit.verdict, formed.fit.values.tolist(), strict=True)
        free = [not (new == 0.0 if word != "not" else new != old) for new, word, old in pairs]
        names = tuple(name for name, on in zip(fit.names, free, strict=True) if on)
        problem = leaning(problem.tuning(names), fit.p, within)
        near = solve(problem)
    sure = unbent(problem, stepped(problem, repeated(problem, carried(problem, near))))
    sure = blurred(problem, sure, inputs)
    sure = moved(problem, sure, joined(formed.problem))
    return told(fit, sure, formed.problem.parameters) if near is not fit else sure


def led(setup: Setup, train: Data, windows: Windows) -> tuple[Windows, Windows]:
    """The rows of recordings before the parts of them that are trained on, which say what these
    begin with, and the parts; none where one is no excerpt of a file, or is cut into windows."""
    listed = [train] if isinstance(train, str | Path) else train
    several = listed if isinstance(listed, Sequence) else ()
    parts = [Excerpt.parse(one) for one in several if isinstance(one, str | Path)]
    if not parts or not all(0.0 < part.start < math.inf for part in parts):
        return (), windows
    earlier = [f"{part.path}@:{part.start}" for part in parts]
    blocks = tuple(Feed(setup.spec, setup.model).blocks(earlier))
    if len(blocks) != len(windows):
        return (), windows
    before, led = list[Block](), list[Block]()
    for block, window in zip(blocks, windows, strict=True):
        task = np.full(len(block.t), window.task[0])
        before.append(block._replace(row=window.row - len(block.t), task=task))
        led.append(window._replace(gap=np.append(False, window.gap[1:])))
    return tuple(before), tuple(led)


def _unknown(work: Work, formed: Formed) -> str:
    """What is left of the best form that was tried: it depends on an input, or is too much."""
    told = branch(formed.fit, formed.problem)
    if told.evidence["dependence"]:
        return told.reason
    return falls_short(work.setup, formed.problem, formed.fit)


def posed(
    setup: Setup, versions: Versions, number: int, blocks: Iterable[Block]
) -> tuple[Problem, Screened, ParameterVector]:
    """What version ``number`` is tuned on: the problem, the tasks that its windows are of, and the
    parameters by which these are trusted: a map is put in scale by most of its rows first."""
    version, base, work = versions[number], versions.model(number), Work(setup, versions)
    recorded = tuple(blocks)

    def by(p: ParameterVector) -> tuple[Problem, Screened]:
        tasks = screened(setup, base, p, recorded)
        check_initials(setup, base, tasks.rows)
        windows = starts(setup, windows_of(tasks.rows, setup.spec.tuning.cut))
        return work.problem(version, windows, work.editable(version)), tasks

    problem, tasks = by(version.p)
    trusted = trimmed(problem)
    if not np.array_equal(trusted, version.p):
        problem, tasks = by(trusted)
    return problem, tasks, trusted


def _watched(problem: Problem, stop: Interrupt, watch: Watch | None) -> Problem:
    """The problem, whose searches end when they are asked to: all of them."""

    def progress(evaluations: int, cost: float) -> bool:
        if not stop.asked and watch is not None and watch(evaluations, cost) is False:
            stop.asked = True
        return not stop.asked

    return replace(problem, settings=replace(problem.settings, progress=progress))


def fit(
    setup: Setup, versions: Versions, number: int, data: tuple[Data, Any],
    watch: Watch | None = None, engine: Engine | None = None,
) -> FitResult:  # fmt: skip
    """Tunes version ``number`` on ``data``'s first part, judges it on each of the second.

    The first Ctrl-C ends a search with the best values so far, which are then judged.
    """
    train, test = data
    done = tune(setup, versions, number, train, watch, engine)
    formed, model, found = done.formed, done.model, done.formed.fit
    items = tuple(each(test))
    screens = [done.rows(listed(item)) for item in items]
    tests = [
        (named(item), done.judged(seen.rows)) for item, seen in zip(items, screens, strict=True)
    ]
    failed = Failed.together(seen.failed for seen in screens)
    doubt = _doubt(setup, done, versions[number].p)
    asked = [f"of {one.source}" for one in done.feed.left_out if one.doubt]
    found = _open(found, [*asked, *["of what was read"] * bool(doubt)])
    together = [prediction for _, one in tests for prediction in one.predictions]
    rule = setup.spec.filter
    own = done.judged(done.tasks, own=False).predictions
    return FitResult(
        setup.spec.name, found, deviations(setup, own),
        deviations(setup, together) if tests else (),
        tuple((name, deviations(setup, one.predictions)) for name, one in tests),
        dict(done.chosen.laws), dict(done.chosen.causes),
        None if rule is None else {"kind": rule.kind, "order": rule.order, "cutoff": rule.cutoff},
        model.parameters.with_values(found.p), formed.form, done.unknown, formed.search,
        tuple(tuple(one.begun) for _, one in tests),
        done.feed.left_out, _spoiled(model, done.tasks),
        _held(setup, model, found, (own, together), failed if tests else done.screened.failed),
        Failed.together([done.screened.failed, failed]), done.screened.unknown,
        doubt, seen_sizes(setup, own), setup.once,
    )  # fmt: skip


def _doubt(setup: Setup, done: Tuned, p: ParameterVector) -> str:
    """What a channel was read as, by which numbers tuned from ``p`` are none of the machine."""
    told, tuned = Numbered(done.base, p), Numbered(done.model, done.formed.fit.p)
    found = read_otherwise(setup, told, tuned, done.tasks)
    return f"the numbers below may be wrong: {found}" if found else ""


def _open(fit: Fit, doubted: Sequence[str]) -> Fit:
    """The fit; rows that may have been read wrongly tell no number before that is known."""
    if not doubted:
        return fit
    why = f"told once the question {' and '.join(doubted)} is answered"
    words = tuple("weak" if word == "identifiable" else word for word in fit.verdict)
    reasons = tuple("; ".join(filter(None, (why, reason))) for reason in fit.reasons)
    return replace(fit, verdict=words, reasons=reasons)


def _held(
    setup: Setup, model: Model, found: Fit,
    seen: tuple[list[Prediction], list[Prediction]], failed: Failed | None,
) -> Held | None:  # fmt: skip
    """Is the requirement reached on what was not learned from, or else on what was? None: there is
    none. ``seen``: predictions of either; ``failed``: rows that have none."""
    if not math.isfinite(setup.requirement):
        return None
    off = as_required(setup, model, found.p, seen[1] or seen[0]).tolist()
    outputs = {
        name: (off[k], setup.shown(k, off[k]), setup.shown(k, setup.requirement))
        for k, name in enumerate(model.outputs.names)
        if setup.watched[k] and math.isfinite(off[k])
    }
    advice = "" if setup.static or setup.spec.correction.in_fit else SEEK
    names = zip(model.outputs.names, setup.watched, strict=True)
    silent = tuple(name for name, asked in names if asked and name not in outputs)
    counts = [(np.isfinite(w.residual) & w.moving)[:, setup.watched] for w in seen[1] or seen[0]]
    left = int(sum(map(np.count_nonzero, counts))) - (0 if seen[1] else len(found.names))
    few = max(left, 0) if left < LEFT else -1
    return Held(
        setup.requirement, setup.relative, bool(seen[1]), outputs, advice, failed, silent, few
    )


def _spoiled(model: Model, tasks: tuple[Block, ...]) -> dict[str, int]:
    """Channel → rows that were measured and cannot be; without those that have none."""
    wrong = sum((one.mark == Mark.ERROR).sum(axis=0) for one in tasks)
    names = (*model.inputs.names, *model.outputs.names)
    counts = zip(names, np.asarray(wrong).tolist(), strict=True)
    return {name: count for name, count in counts if count}


def named(item: Any) -> str:
    """What a recording is called."""
    return item if isinstance(item, str) else getattr(item, "name", "") or "rows"


def each(tests: Any) -> tuple[Any, ...]:
    """Recordings to be judged alone; one is one of them."""
    alone = isinstance(tests, str | Path | Mapping | Block) or hasattr(tests, "columns")
    return (tests,) if alone else tuple(tests)


def listed(item: Any) -> Any:
    """One file is a list of one; blocks and columns are taken as they are."""
    if isinstance(item, Block):
        return (item,)
    return [item] if isinstance(item, str) or hasattr(item, "exists") else item
