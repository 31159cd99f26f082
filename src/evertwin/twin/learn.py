"""How a correction is learned: a translation table by SARSA, or a search over all kinds of term.

The twin file says which (`[correction]`): ``refine = false`` stops at the table.
"""

from __future__ import annotations

import numpy as np

from evertwin.correction.evidence import gather
from evertwin.correction.improve import Gain, Proposal, Selection, improve
from evertwin.correction.sarsa import learn_table
from evertwin.correction.sarsa_settings import SarsaSettings
from evertwin.correction.sarsa_settings import propose as propose_actions
from evertwin.fold import Block
from evertwin.models import Model
from evertwin.models.corrected import build
from evertwin.models.form import Form, Term, Version
from evertwin.twin.setup import Setup

__all__ = ["learn"]

Windows = tuple[Block, ...]


def learn(setup: Setup, base: Model, version: Version, windows: Windows) -> Proposal:
    """A proposal for a corrected form of ``version``, learned on ``windows``."""
    rule = setup.spec.correction
    if "table" in rule.terms and not rule.refine:
        return _table(setup, base, version, windows)
    settings = Selection(
        kinds=rule.terms, channels=rule.channels, quantum=rule.quantum,
    )  # fmt: skip
    return improve(base, version.form, windows, setup.horizon, settings, version.p)


def sarsa_settings(setup: Setup, channel: str, windows: Windows) -> SarsaSettings:
    """The agent's settings; its range is proposed from the data where no quantum is given."""
    rule = setup.spec.correction
    column = setup.model.inputs.index(channel)
    commands = np.concatenate([w.u[:, column] for w in windows])
    top = float(np.nanmax(commands))
    if rule.quantum > 0:
        low = min(0.0, float(np.nanmin(commands)))
        count = int(np.ceil((top - low) / rule.quantum - 1e-9)) + 1
        quantum = rule.quantum
    else:
        low, quantum, count = propose_actions(commands, commands)
    return SarsaSettings(
        channel, low, quantum, count, horizon=setup.horizon, mode=rule.learner, watch=rule.watch,
    )  # fmt: skip


def _table(setup: Setup, base: Model, version: Version, windows: Windows) -> Proposal:
    """The table alone, in place of the terms that the version has."""
    channel = setup.spec.correction.channels[0]
    settings = sarsa_settings(setup, channel, windows)
    p = version.p[: len(base.parameters)]
    table = learn_table(base, p, windows, settings)
    term = Term("table", channel, levels=tuple(table.levels.tolist()))
    form = Form((term,), version.form.variant)
    model, values = build(base, form), np.concatenate([p, table.values])
    seen = gather(base, windows, setup.horizon, p=p)
    before = float(seen.deviations(seen.residual(base, p)).mean())
    after = float(seen.deviations(seen.residual(model, values)).mean())
    detail = f"{channel}: {int(table.learned.sum())} of {len(table.levels)} levels learned"
    gain = Gain(term, before, after, seen.segments, detail=detail)
    gains = (gain,) if after < before else ()
    return Proposal(
        form, model.parameters.names, values, before, after, seen.scale, gains, (detail,), {}
    )
