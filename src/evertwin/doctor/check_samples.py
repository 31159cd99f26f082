"""Is each row of a recording a sample of its own? Numbers that stand for no value, values that are
held, recordings that repeat.

A held channel moves by jumps of many of its steps, and still stands between them for as many rows
each time. What stands because it moves slowly (an encoder) jumps by single steps; what is set now
and then (a command) stands for long, or for as long as it likes.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from evertwin.doctor.examination import Samples, View
from evertwin.doctor.finding import Finding
from evertwin.rows.channels import is_held, recorded_as
from evertwin.signals import from_si
from evertwin.sources.columns.no_value import no_value

STEPS = 3
"""A jump of so many steps of a channel would not have stood still before, had it been sampled."""
JUMPS = 30
"""Jumps that must be seen."""
LONGEST = 20
"""Rows that a measurement may be held; what stands for longer is set on purpose."""
REGULAR = 0.85
"""Share of the jumps that come after the same number of rows, or the one next to it."""
NAMED = 4
"""Pairs of files that are named."""


def look_samples(view: View) -> Iterator[Finding]:
    """Numbers that stand for no value, held channels, and recordings that are there twice."""
    yield from _no_value(view)
    yield from _held(view)
    yield from _repeated(view)


def _behind(view: View, commands: bool) -> set[str]:
    """Recorded channels that inputs come from; only of those that are commands, held by right."""
    spec, dynamic = view.setup.spec, not view.setup.static
    names = view.model.inputs.names
    raw = {recorded_as(spec, n) for n in names if not commands or is_held(spec, n, dynamic)}
    for rule in reversed(spec.derive):
        if rule.name in raw:
            raw |= set(rule.source)
    return raw


def _by_source(view: View) -> Iterator[list[Samples]]:
    """The recordings of each source."""
    for source in dict.fromkeys(one.source for one in view.recorded):
        yield [one for one in view.recorded if one.source == source]


def _no_value(view: View) -> Iterator[Finding]:
    """Of what is measured; in a command it may be meant."""
    passed, said = _behind(view, commands=True), {s.name: s for s in view.setup.spec.source}
    for tasks in _by_source(view):
        channels = said[tasks[0].source].channels if tasks[0].source in said else {}
        for k, name in enumerate(tasks[0].names):
            if name in passed or name not in channels:
                continue
            one, si = channels[name], np.concatenate([task.v[:, k] for task in tasks])
            cells = (from_si(si[np.isfinite(si)], one.unit) - one.offset) / one.scale
            found = no_value(cells)
            if found is None:
                continue
            part = 100 * float(np.mean(cells == found))
            also = ", ".join(f"{float(f'{x:.9g}'):g}" for x in (*one.sentinels, found))
            yield Finding(
                "sentinel", name,
                f"{name}: the file says {float(f'{found:.9g}'):g} in {part:.3g} % of its cells, "
                "each time far off those beside it",
                f"source {tasks[0].source}",
                "where that stands for no value: leave these cells empty, or write in "
                f"[source.channels] {name} = {{ …, sentinels = [{also}] }}",
                {"value": found, "share": 0.01 * part},
            )  # fmt: skip


def _held(view: View) -> Iterator[Finding]:
    smooth = view.setup.spec.filter
    passed = _behind(view, commands=True) | set(smooth.inputs if smooth else ())
    for tasks in _by_source(view):
        found: dict[str, list[str]] = {}
        for k, name in enumerate(tasks[0].names):
            rows = 0.0 if name in passed else held_rows([task.v[:, k] for task in tasks])
            if rows:
                found.setdefault(f"{rows:.2g}", []).append(name)
        for text, listed in found.items():
            yield _stands(tasks[0], text, listed, view.setup.static)


def _stands(task: Samples, rows: str, listed: list[str], static: bool) -> Finding:
    shown, rate = ", ".join(listed), 1 / (task.step * float(rows))
    smooth = f"[filter] inputs = {listed} with a cutoff below {rate / 2:.2g} Hz, or "
    return Finding(
        "held", listed[0],
        f"{shown}: each value stands for {rows} rows while it moves: sampled every {rows} rows",
        f"source {task.source}",
        f"{smooth if static else ''}record at {rate:.2g} Hz, the rate of the samples: their jumps "
        "are learned as motion",
        {"channels": listed, "rows": float(rows)},
    )  # fmt: skip


def held_rows(columns: list[np.ndarray]) -> float:
    """For how many rows each value of a moving channel is held; 0 where it is not.

    >>> held_rows([np.sin(0.01 * (np.arange(600) // 3 * 3))])
    3.0
    >>> held_rows([np.sin(0.01 * np.arange(600))])
    0.0
    """
    runs = np.concatenate([_runs(column[np.isfinite(column)]) for column in columns])
    runs = runs[runs <= 3 * LONGEST]
    if len(runs) < JUMPS:
        return 0.0
    typical = float(np.median(runs))
    mean = float(runs[np.abs(runs - typical) <= 1].mean())
    regular = float(np.mean((runs >= np.floor(mean)) & (runs <= np.ceil(mean))))
    return round(mean, 2) if 1.4 < mean <= LONGEST and regular >= REGULAR else 0.0


def _runs(column: np.ndarray) -> np.ndarray:
    """Rows that a value stood between two jumps of the same direction, both of many steps."""
    if len(column) < JUMPS:
        return np.zeros(0)
    low, high = np.quantile(column, [0.005, 0.995])  # a spike is no range
    grain = 1e-8 * float(high - low)
    if grain <= 0:
        return np.zeros(0)
    levels = np.unique(np.round(np.clip(column, low, high) / grain))
    step = grain * float(np.quantile(np.diff(levels), 0.01))
    at = np.flatnonzero(np.diff(column) != 0)
    jump = np.diff(column)[at]
    many = np.where(np.abs(jump) >= STEPS * step, np.sign(jump), 0.0)
    between = many[1:] * many[:-1] > 0
    return np.asarray(np.diff(at)[between], dtype=np.float64)


def _repeated(view: View) -> Iterator[Finding]:
    """Recordings whose measured values are those of another one."""
    inputs = _behind(view, commands=False)
    for tasks in _by_source(view):
        pairs: dict[tuple[int, int], list[str]] = {}
        for k, name in enumerate(tasks[0].names):
            for pair in _equal(tasks, k) if name not in inputs else ():
                pairs.setdefault(pair, []).append(name)
        if not pairs:
            continue
        shown = "; ".join(f"{tasks[i].file} = {tasks[j].file}" for i, j in list(pairs)[:NAMED])
        more = f" and {len(pairs) - NAMED} further pairs" if len(pairs) > NAMED else ""
        twice = sorted({j for _, j in pairs})
        channels = list(dict.fromkeys(name for listed in pairs.values() for name in listed))
        yield Finding(
            "repeated", channels[0],
            f"{', '.join(channels)} the same, row by row, in different recordings: {shown}{more}",
            f"source {tasks[0].source}",
            f"leave out {len(twice)} of {len(tasks)} recordings: they hold nothing new; if their "
            "motion differs, these values were computed and not measured",
            {"pairs": [[tasks[i].file, tasks[j].file] for i, j in pairs]},
        )  # fmt: skip


def _equal(tasks: list[Samples], k: int) -> Iterator[tuple[int, int]]:
    """Pairs of tasks in which a channel that moves has the same values."""
    same: dict[bytes, list[int]] = {}
    for i, task in enumerate(tasks):
        column = np.ascontiguousarray(task.v[:, k])
        if len(np.unique(column[np.isfinite(column)])) >= JUMPS:
            same.setdefault(column.tobytes(), []).append(i)
    for listed in same.values():
        yield from combinations(listed, 2)
