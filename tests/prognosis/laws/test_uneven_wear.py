"""Lives told alone of drawn wear that no law is like, seen as in a workshop."""

from __future__ import annotations

import numpy as np

from evertwin.prognosis.laws import Indicator, Life, Limit, predict_life
from planted.draws import first_of
from planted.metrics import covers, crps
from planted.uneven import UNEVEN
from planted.unlike import Kind, Stranger, kind_of, stranger


def seen(kind: Kind, one: Stranger, share: float) -> Indicator:
    """What is known of a component at a share of its life."""
    known = one.at <= share * one.life
    side = "above" if kind.limit > kind.new else "below"
    return Indicator.of("wear", "1", Limit(kind.limit, side), one.at[known], one.value[known])


@first_of("seed", range(2))
def test_answers_at_seven_tenths_of_life_hold_and_lose_little(seed: int) -> None:
    loss, held = [], []
    for number, law in enumerate(UNEVEN):
        rng = np.random.default_rng([seed, number])
        kind = kind_of(law, rng)
        for one in [stranger(kind, rng) for _ in range(3)]:
            history = seen(kind, one, 0.7)
            life, left = predict_life(history), one.life - float(history.at[-1])
            if isinstance(life, Life):
                loss.append(crps(life, left) / one.life)
                held.append(covers(life.interval80, left))
    assert len(held) >= 0.9 * 3 * len(UNEVEN)
    assert np.mean(held) >= 0.88
    assert np.mean(loss) < 0.115
