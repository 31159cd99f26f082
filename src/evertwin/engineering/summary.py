"""A study as text, for the console: what was chosen and why, one line a choice.

>>> from evertwin.engineering.summary import table
>>> print(table([("axis", "share"), ("tau1", "0.98")]))
axis  share
tau1  0.98
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from evertwin.engineering.study import Study


def summary(study: Study) -> str:
    """The whole study, step by step."""
    return "\n".join(_lines(study))


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of cells in columns; the last column runs free."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def _lines(study: Study) -> Iterator[str]:
    yield f"{study.breakdown.name}: {len(study.ranks)} components, {study.rows} rows"
    yield ""
    yield "1. components: effect × proneness, and how deeply each is modelled"
    rows = [("component", "score", "role", "level", "why")]
    for one, level in zip(study.ranks, study.levels, strict=True):
        marks = "*" * bool(one.overridden), "*" * bool(level.overridden)
        rows.append(
            (one.component, f"{one.score:.1f}", one.role + marks[0], level.level + marks[1],
             level.reason)
        )  # fmt: skip
    yield table(rows)
    told = [one.overridden for one in study.ranks] + [one.overridden for one in study.levels]
    if any(told):
        yield "* overridden by the engineer"
    for level in study.levels:
        for missing in level.missing:
            yield f"   missing for {level.component}: {missing.what}: {missing.how}"
    yield ""
    yield "2. signals to parameters"
    yield from _signals(study)
    yield ""
    if study.identified is not None:
        yield f"   {len(study.identified.found)} initial values by a first fit to these rows:"
        for output, at in study.identified.before.items():
            yield f"   {output}: {at:.1%} off before, {study.identified.after[output]:.1%} after"
        yield ""
    yield "3. parameters: which are tuned"
    rows3 = [("parameter", "", "why")]
    for choice in study.chosen.choices:
        rows3.append((choice.name, "tune" if choice.editable else "keep", choice.reason))
    yield table(rows3)
    yield ""
    yield "4. how often, measured"
    yield from _schedule(study)


def _signals(study: Study) -> Iterator[str]:
    for link in study.links:
        seen = ", ".join(f"{s.signal} ({s.how}, {s.effect:.1%})" for s in link.signals[:3])
        yield f"   {link.parameter}: {seen or 'cannot be observed'}"
    for one in study.virtual:
        yield (
            f"   {one.component} makes {one.rms:.3g} {one.unit} of {one.signal}, "
            f"{one.share:.1%} of it"
        )
    for quantity in study.inside:
        yield (
            f"   virtual sensor {quantity.component}.{quantity.quantity}: "
            f"{quantity.rms:.3g} {quantity.unit} rms"
        )
    for note in study.notes:
        yield f"   note: {note}"


def _schedule(study: Study) -> Iterator[str]:
    if study.weighed is None or study.measured is None:
        yield "   nothing is tuned"
        return
    for name, reason in study.weighed.reasons.items():
        weight = study.weighed.weights[name]
        yield f"   {name}: every {_nth(weight)} tuning; {reason}"
    found, needs = study.measured, study.breakdown.requirements
    yield (
        f"   {found.tunings} tunings: {found.count} instead of {found.count_all} parameters, run "
        f"time {1e3 * found.seconds:.1f} instead of {1e3 * found.seconds_all:.1f} ms "
        f"({found.saved:.0%} saved), largest loss of accuracy {found.lost:.2%}"
    )
    if found.saved_simulations is not None:
        yield (
            f"   by rounds, output by output: {found.simulations} instead of "
            f"{found.simulations_all} simulations ({found.saved_simulations:.0%} saved)"
        )
    reached = study.chosen.fit
    if reached is not None:
        worst = max(reached.moving_after)
        met = "met" if study.met.get("accuracy") else "NOT met"
        yield f"   accuracy: worst output {worst:.1%} off, asked {needs.accuracy:.0%}: {met}"
    met = "met" if study.met.get("accuracy by the schedule") else "NOT met"
    yield (
        f"   by the schedule: worst output {max(found.deviation.values()):.1%} off at any turn, "
        f"asked {needs.accuracy:.0%}: {met}"
    )
    if needs.run_time is not None and study.run_time is not None:
        met = "met" if study.met.get("run_time") else "NOT met"
        yield f"   run time of a tuning {1e3 * study.run_time:.2f} ms, asked " + (
            f"{1e3 * needs.run_time:g} ms: {met}"
        )


def _nth(weight: float) -> str:
    turns = round(1.0 / weight)
    if turns == 1:
        return "single"
    teen = 10 <= turns % 100 <= 20
    ending = "th" if teen else {1: "st", 2: "nd", 3: "rd"}.get(turns % 10, "th")
    return f"{turns}{ending}"
