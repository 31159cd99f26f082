"""How a correction is learned.

One corrected input whose table may be learned: SARSA learns the translation table, which is refined
into a continuous law with a lag (``refine = false`` stops at the table). Anything else: a search
over all kinds of term that the twin file allows, each of which has to pay on held-out rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace

import numpy as np

from evertwin.correction.describe import describe
from evertwin.correction.evidence import gather, mean_deviation
from evertwin.correction.search.absorbed import plainest
from evertwin.correction.search.improve import Gain, Proposal, Selection, improve
from evertwin.correction.search.own_numbers import few_numbers
from evertwin.correction.stack import stack_of
from evertwin.correction.translation.command_effect import command_effects
from evertwin.correction.translation.refine_law import refine_law
from evertwin.correction.translation.sarsa import learn_table
from evertwin.correction.translation.sarsa_settings import SarsaSettings
from evertwin.correction.translation.sarsa_settings import propose as propose_actions
from evertwin.correction.translation.table import Table
from evertwin.errors import TooFew
from evertwin.fold import Windows
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.form import Form, Term, Version
from evertwin.models.terms.rows import level_count
from evertwin.refit.rows.recall import recalled
from evertwin.setup.setup import Setup
from evertwin.types import Vector

CLEARLY = 0.05
"""Part of the deviation by which a proposal from other numbers has to be the better one."""
TRANSLATION = ("table", "law", "lag")
"""Kinds of term that a translation is made of."""
SHOWN = ("channel", "levels", "values", "visits", "learned")
"""What an event keeps of a translation table."""


def learn(
    setup: Setup, base: Model, version: Version, windows: Windows, *, beside: bool = False
) -> Proposal:
    """A corrected form of ``version`` that is searched for on ``windows``, by all kinds but a table
    that an agent learns; ``beside``: with the model's numbers tuned beside each term."""
    rule = setup.spec.correction
    kinds = tuple(name for name in rule.terms if name != "table" or not rule.translated)
    settings = Selection(
        kinds, rule.channels, quantum=rule.quantum, outputs=rule.outputs,
        numbers=setup.editable, beside=beside,
    )  # fmt: skip
    return improve(base, version.form, windows, setup.horizon, settings, version.p)


def sought(
    setup: Setup, versions: Versions, starts: Sequence[Version], windows: Windows
) -> Proposal:
    """A proposal for a corrected form of the last of these versions: a translated input, or what is
    searched for where kinds are named that a translation does not come to."""
    rule, found = setup.spec.correction, list[Proposal]()
    if rule.translated:
        found = [_translation(setup, setup.model, start, windows) for start in starts]
    if not {*rule.terms} <= {*TRANSLATION} or not found:
        try:
            found.append(_searched(setup, versions, starts, windows))
        except TooFew:
            if not found:
                raise
    return nearest(versions, found, windows, setup.horizon)


def _searched(
    setup: Setup, versions: Versions, starts: Sequence[Version], windows: Windows
) -> Proposal:
    """Where the model's numbers are tuned beside each term it is enough to begin with the last
    version, if a term is found."""
    base = setup.model
    if few_numbers(setup.editable):
        found = learn(setup, base, starts[-1], windows, beside=True)
        if found.found:
            return found
    proposals = [learn(setup, base, start, windows) for start in starts]
    return nearest(versions, proposals, windows, setup.horizon)


def nearest(
    versions: Versions, proposals: Sequence[Proposal], windows: Windows, horizon: float
) -> Proposal:
    """The first of them, its numbers alone where it found no term, unless another one is nearer to
    the windows by `CLEARLY`."""
    best = proposals[0]
    for other in (one for one in proposals[1:] if one.found):
        models = [versions.model_of(one.form) for one in (best, other)]
        seen = gather(models[0], windows, horizon, p=best.p)
        here, there = (
            mean_deviation(seen.deviations(seen.residual(model, one.p)))
            for model, one in zip(models, (best, other), strict=True)
        )
        best = other if there < (1.0 - CLEARLY) * here else best
    return best


def sarsa_settings(setup: Setup, channel: str, windows: Windows) -> SarsaSettings:
    """The agent's settings; its range is proposed from the data where no quantum is given."""
    rule = setup.spec.correction
    column = setup.model.inputs.index(channel)
    commands = np.concatenate([w.u[:, column] for w in windows])
    top = float(np.nanmax(commands))
    if rule.quantum > 0:
        low = min(0.0, float(np.nanmin(commands)))
        count, quantum = level_count(low, top, rule.quantum), rule.quantum
    else:
        p = setup.model.parameters.values
        seen = command_effects(setup.model, p, windows, channel, setup.horizon)
        low, quantum, count = propose_actions(*seen)
    return SarsaSettings(
        channel, low, quantum, count, horizon=setup.horizon, mode=rule.learner, watch=rule.watch,
        **{item.name: getattr(rule.sarsa, item.name) for item in fields(rule.sarsa)},
    )  # fmt: skip


def _translation(setup: Setup, base: Model, version: Version, windows: Windows) -> Proposal:
    """The translation of one input, in place of the terms that the version has."""
    channel = setup.spec.correction.translated
    settings = sarsa_settings(setup, channel, windows)
    newest = setup.rows(setup.spec.correction.window)
    windows = recalled(windows, newest, base.inputs.index(channel), settings)
    p = version.p[: len(base.parameters)]
    table = learn_table(base, p, windows, settings)
    terms: tuple[Term, ...] = (Term("table", channel, levels=tuple(table.levels.tolist())),)
    column = base.inputs.index(channel)
    given = np.concatenate([window.u[:, column] for window in windows])
    said, taken = tuple(_said(table, given, base.inputs.units[column])), tuple[str, ...]()
    values = table.values.tolist()
    if setup.spec.correction.refine:
        refined = refine_law(base, p, windows, table, setup.horizon)
        terms, values = refined.terms, list(refined.values.values())
    found = stack_of(base, Form(terms, version.form.variant), np.array([*p, *values]))
    bare = replace(found, parts=())
    seen = gather(found.base, windows, setup.horizon, p=p)
    if setup.spec.correction.refine:
        found, taken = plainest(found, range(len(found.parts)), setup.editable, seen)
        said = (*describe(found), *said[1:])
    before, after = (
        mean_deviation(seen.deviations(seen.residual(one.model, one.p))) for one in (bare, found)
    )
    gains = tuple(
        Gain(part.term, before, after, seen.segments, detail=said[0]) for part in found.parts[:1]
    )
    return Proposal(
        Form(tuple(part.term for part in found.parts), version.form.variant),
        found.model.parameters.names, found.p, before, after, seen.scale,
        gains=gains if after < before else (), describes=said, taken=taken,
        table={name: getattr(table, name) for name in SHOWN},
        unseen=tuple(table.levels[table.visits == 0].tolist()),
    )  # fmt: skip


def _said(table: Table, given: Vector, unit: str) -> Iterator[str]:
    """What the table rests on, and the missing excitation in words; ``given``: the commands, which
    may pass a level and not stay there."""
    levels = table.levels
    middles = 0.5 * (levels[1:] + levels[:-1])
    passed = np.isin(np.arange(len(levels)), np.digitize(given[np.isfinite(given)], middles))
    yield f"{table.channel}: {int(table.learned.sum())} of {len(levels)} levels learned"
    never = (table.visits == 0) & ~passed
    opens = np.flatnonzero(np.diff(never, prepend=False, append=False)).tolist()
    found = [
        f"{levels[a]:g}" if b == a + 1 else f"{levels[a]:g} to {levels[b - 1]:g}"
        for a, b in zip(opens[::2], opens[1::2], strict=True)
    ]
    if found:
        yield f"{table.channel} was not seen at {', '.join(found)} {unit}".removesuffix(" 1")
