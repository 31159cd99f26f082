"""How often a correction's intervals hold what was planted: `python -m proofs.intervals [SEEDS]`.

A robot on a line, 1 Hz, 300 s, commands of 0 to 0.2 m/s held 3 s, position noise 2 mm. Planted: a
start threshold of 6 cm/s (dead zone, clamp), a delay of 0.3 s, a delay of 0.05 s beside a time
constant of 0.1 s. And a robot in the plane whose forward speed falls with its turn rate: a surface
over both is learned as the twin learns it, and its nodes' intervals are counted where a node is
called identifiable. Aim: 95 %.
"""

from __future__ import annotations

import sys

import numpy as np

from evertwin.correction.evidence import gather
from evertwin.correction.improve import Selection, improve
from evertwin.correction.intervals import profiled, scattered
from evertwin.errors import EvertwinError
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Differential, Robot1D
from evertwin.models.corrected import Corrected
from evertwin.models.form import Form, Term

NOISE, HORIZON = 2e-3, 3.0
CASES = {
    "threshold, dead zone": (Term("law", "v", variant="dead zone"), {"law.v.threshold": 0.06}),
    "threshold, clamp": (Term("law", "v", variant="clamp"), {"law.v.threshold": 0.06}),
    "delay": (Term("lag", "v", variant="delay"), {"lag.v.delay": 0.3}),
    "delay beside tau": (Term("lag", "v"), {"lag.v.delay": 0.05, "lag.v.tau": 0.1}),
}


def rows(seed: int, model: Corrected, p: np.ndarray) -> Block:
    """A recording."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.0, 0.2, 100), 3)[:, None]
    _, y = model.simulate(model.initial(p), u, np.ones(300), p)
    y = y + rng.normal(0.0, NOISE, y.shape)
    return make_block(t=np.arange(300) * 10**9, u=u, y=y)


def one(seed: int, term: Term, planted: dict[str, float]) -> tuple[bool, float]:
    """Is the first planted number inside its interval, found from the best value on a grid?"""
    model = Corrected(Robot1D(), (term,))
    p = model.parameters.with_values(planted).values
    seen = gather(Robot1D(), (rows(seed, model, p),), HORIZON)
    name, value = next(iter(planted.items()))
    place, costs = model.parameters.index(name), []
    grid = value + np.linspace(-min(value, 0.1), 0.1, 81)
    for at in grid:
        q = p.copy()
        q[place] = at
        costs.append(float((seen.residual(model, q) ** 2).sum()))
    p[place] = grid[int(np.argmin(costs))]
    low, high = profiled(model, p, (name,), tuple(planted), seen)[name].interval95
    return low <= value <= high, high - low


def surface(seed: int) -> tuple[int, int]:
    """Nodes called identifiable whose interval holds the planted value, and how many there are."""
    rng, base = np.random.default_rng(seed), Differential()
    v, w = (np.repeat(rng.uniform(-a, a, 200), 3) for a in (0.3, 0.6))
    truth = v - np.copysign(np.minimum(0.3 * np.abs(w), np.abs(v)), v) * 0.5
    p = base.parameters.values
    _, y = base.simulate(base.initial(p), np.c_[truth, w], np.full(600, 0.5), p)
    y = y + rng.normal(0.0, NOISE, y.shape)
    block = make_block(t=np.arange(600) * 5 * 10**8, u=np.c_[v, w], y=y)
    try:
        found = improve(base, Form(), (block,), HORIZON, Selection(kinds=("surface",)))
    except EvertwinError:
        return 0, 0
    if not found.found:
        return 0, 0
    model = Corrected(base, found.form.terms)
    seen = gather(base, (block,), HORIZON, found.scale)
    term = found.form.terms[0]
    names = [n for n in found.names if n.startswith("surface.")]
    known = scattered(model, found.p, names, seen)
    held = count = 0
    for name in names:
        i, j = (int(k) for k in name.rsplit(".", 2)[1:])
        at, turn = term.levels[i], term.levels2[j]
        value = -np.copysign(min(0.3 * abs(turn), abs(at)), at) * 0.5
        if known[name].verdict != "identifiable":
            continue
        low, high = known[name].interval95
        held, count = held + (low <= value <= high), count + 1
    return held, count


def main() -> int:
    """Prints the shares."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    for case, (term, planted) in CASES.items():
        found = [one(seed, term, planted) for seed in range(seeds)]
        share, width = np.mean([held for held, _ in found]), np.median([w for _, w in found])
        error = 196 * np.sqrt(share * (1 - share) / seeds)
        print(f"{case:22}{100 * share:6.1f} ± {error:.1f} % of {seeds}, median width {width:.3g}")
    counted = [surface(seed) for seed in range(max(seeds // 10, 1))]
    held, count = (sum(column) for column in zip(*counted, strict=True))
    print(f"{'nodes of a surface':22}{100 * held / max(count, 1):6.1f} % of {count} nodes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
