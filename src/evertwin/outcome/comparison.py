"""Two versions over the same rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from evertwin.fold import plain
from evertwin.ledger.versions import Versions
from evertwin.models.form import Version
from evertwin.rows.feed import Data, Feed
from evertwin.setup.evaluation import Deviation, Prediction, deviations, predict
from evertwin.setup.setup import Setup
from evertwin.types import Json


@dataclass(frozen=True)
class Comparison:
    """Deviations of two versions.

    >>> Comparison.__name__
    'Comparison'
    """

    versions: tuple[Version, Version]
    deviations: tuple[tuple[Deviation, ...], tuple[Deviation, ...]]
    better: float
    """Share of the rows at which the second predicts better."""
    rows: int
    predictions: tuple[Sequence[Prediction], Sequence[Prediction]] = field(repr=False)
    """Of each version, window by window; not part of the plain content."""

    def __repr__(self) -> str:
        a, b = (version.number for version in self.versions)
        share = f"{b} is better at {100 * self.better:.0f} % of {self.rows} rows"
        return f"<Comparison of versions {a} and {b}: {share}>"

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.compare/1"``."""
        return plain(  # type: ignore[return-value]
            {
                "schema": "evertwin.compare/1",
                "rows": self.rows,
                "better_share": self.better,
                "versions": [
                    {
                        "version": v.number,
                        "hash": v.hash,
                        "reason": v.reason,
                        "outputs": {d.name: d.to_dict() for d in found},
                    }
                    for v, found in zip(self.versions, self.deviations, strict=True)
                ],
            }
        )

    def __str__(self) -> str:
        a, b = self.versions
        lines = [f"version {a.number} and version {b.number} over {self.rows} rows"]
        for first, second in zip(*self.deviations, strict=True):
            (before, unit), (after, _) = first.told, second.told
            lines.append(
                f"  {first.name:<10} rms {before:.4g} -> {after:.4g} {unit}   "
                f"relative {100 * first.relative_rms:.2f} -> {100 * second.relative_rms:.2f} %"
            )
        lines.append(f"  version {b.number} is nearer at {100 * self.better:.1f} % of the rows")
        return "\n".join(lines)


def compare(setup: Setup, versions: Versions, pair: tuple[int, int], data: Data) -> Comparison:
    """Both versions' predictions over one horizon, of all rows of ``data``."""
    windows = tuple(Feed(setup.spec, setup.model).blocks(data))
    chosen = versions[pair[0]], versions[pair[1]]
    found: list[list[Prediction]] = [
        [predict(setup, versions.model(v.number), v.p, window) for window in windows]
        for v in chosen
    ]
    a, b = (np.concatenate([p.residual for p in predictions]) for predictions in found)
    known = np.isfinite(a).any(axis=1) & np.isfinite(b).any(axis=1)
    nearer = np.nansum(np.square(b), axis=1) < np.nansum(np.square(a), axis=1)
    share = float(nearer[known].mean()) if known.any() else float("nan")
    first, second = (deviations(setup, predictions) for predictions in found)
    return Comparison(
        chosen, (first, second), share, sum(len(w.t) for w in windows), (found[0], found[1])
    )
