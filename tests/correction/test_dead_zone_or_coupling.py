"""A coupling may stand in for the dead zone of the input beside it: what pays more is learned."""

from __future__ import annotations

import numpy as np

from evertwin.correction.search.improve import Selection, improve
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Differential
from evertwin.models.form import Form
from evertwin.signals.channels import wrap
from planted.draws import first_of

KINDS = ("lag", "coupling", "law")


def driven(seed: int, *, zone: float = 0.0, slip: float = 0.0) -> Block:
    """A base for 64 s at 5 Hz, commands of 2 s, which lags, and loses a dead zone or by turning."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform((0.05, -1.0), (0.35, 1.0), (32, 2)), 10, axis=0)
    v = np.maximum(u[:, 0] - zone - slip * np.abs(u[:, 1]), 0.0)
    w = np.sign(u[:, 1]) * np.maximum(np.abs(u[:, 1]) - 3.0 * zone, 0.0)
    state, seen = np.zeros(5), np.empty((len(u), 3))
    for k in range(len(u)):
        seen[k] = state[:3]
        state[3:] += (np.array([v[k], w[k]]) - state[3:]) * (1.0 - np.exp(-0.2 / 0.25))
        turned = state[2] + 0.1 * state[4]
        state[:3] += 0.2 * np.array(
            [state[3] * np.cos(turned), state[3] * np.sin(turned), state[4]]
        )
    seen += rng.normal(0.0, (2e-3, 2e-3, 5e-3), seen.shape)
    seen[:, 2] = wrap(seen[:, 2:], np.array([True]))[:, 0]
    return make_block(t=np.arange(len(u)) * 200_000_000, u=u, y=seen)


@first_of("seed", range(4))
def test_a_dead_zone_is_no_coupling(seed: int) -> None:
    found = improve(Differential(), Form(), (driven(seed, zone=0.03),), 1.0, Selection(KINDS))
    terms = {(term.kind, term.channel) for term in found.form.terms}
    assert ("law", "v") in terms and not any(kind == "coupling" for kind, _ in terms)


@first_of("seed", range(4))
def test_a_coupling_is_no_law(seed: int) -> None:
    found = improve(Differential(), Form(), (driven(seed, slip=0.1),), 1.0, Selection(KINDS))
    terms = {(term.kind, term.channel, term.source) for term in found.form.terms}
    assert ("coupling", "v", "w") in terms and ("law", "v", "") not in terms
