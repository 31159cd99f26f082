"""Lives on wear that no law here is like, and on real machines: `python -m proofs.believed [N]`.

`Twin.life` on `twins/wear.toml`, nothing set.

1. *Strangers*: N (100 by default) series of each law of `planted/unlike.py`, at 30, 50, 70 and
   90 % of their lives, alone and with a fleet of 16 like machines. Counted: answers, how many 80 %
   intervals hold the truth, how many truths lie above the lower end, and the CRPS (in whole lives)
   beside dummies at the same moments: the mean life less the age, the fleet's lives beyond this
   age, always 0. `failure_due` with more than 5 times its lead left is counted.
2. *Bearings* (needs EVERTWIN_DATA): every channel of `bearing_ims1` and `bearing_ims2`, asked every
   4 h; the limit is three times the median of the first day. A channel is healthy until 12 h before
   its rig stops. The peer warns at a median of 12 values over 1.3 times that of the first 48 h.
3. *Cells*: 13 of `battery_fleet`, 30 others as fleet, ends at 0.93 Ah; alone and with the fleet.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np

from evertwin.prognosis.laws import Life
from evertwin.prognosis.laws.alarms import alarm_of
from evertwin.prognosis.laws.life import LEVELS
from evertwin.prognosis.lives import ComponentLife
from planted.histories import Columns, Told, until
from planted.metrics import covers, crps
from planted.unlike import LEVELS as LAWS
from planted.unlike import Stranger, kind_of, stranger
from proofs._verdict import ended
from proofs.series import rows

CUTS = (0.3, 0.5, 0.7, 0.9)
FLEET = 16
EACH = 4
"""Strangers that share a fleet."""
HEALTHY = 12.0


class Row(NamedTuple):
    """One question with its answer, scored."""

    cut: float
    answered: bool
    held: bool = False
    above: bool = False
    score: float = np.nan
    dummies: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    early: bool = False


def scored(one: ComponentLife, cut: float, truth: float, whole: float, lives: np.ndarray) -> Row:
    """An answer beside its truth and the dummies."""
    life = one.life
    if not isinstance(life, Life):
        return Row(cut, answered=False)
    age = whole - truth
    beyond = lives[lives > age] - age
    known = np.quantile(beyond, LEVELS) if len(beyond) else np.zeros(len(LEVELS))
    mean = Life("cycle", np.full(len(LEVELS), max(float(lives.mean()) - age, 0.0)))
    none = Life("cycle", np.zeros(len(LEVELS)))
    others = tuple(crps(x, truth) / whole for x in (mean, Life("cycle", known), none))
    due = alarm_of("part", one.indicator, life, LEAD * (age + life.median), RISK)
    lead = LEAD * (age + life.median)
    early = due is not None and due.kind == "failure_due" and truth > 5.0 * lead
    return Row(cut, True, covers(life.interval80, truth), life.interval80[0] <= truth,
               crps(life, truth) / whole, others, early)  # type: ignore[arg-type]  # fmt: skip


LEAD, RISK = 0.1, 0.1
"""Of the alarm: a share of the whole life, and the risk."""


def told(twin: Told, one: Stranger, cut: float, lives: np.ndarray) -> Row:
    """One stranger at a share of its life."""
    known = until({"cycle": one.at, "wear": one.value}, cut * one.life)
    now = float(known["cycle"][-1])
    return scored(twin.component(known), cut, one.life - now, one.life, lives)


def strangers(law: str, count: int, seed: int) -> dict[str, list[Row]]:
    """All questions about one law."""
    found: dict[str, list[Row]] = {"alone": [], "fleet": []}
    for k in range(-(-count // EACH)):
        rng = np.random.default_rng([seed, list(LAWS).index(law), k])
        kind = kind_of(law, rng)
        rule = {"limit": kind.limit, "direction": "above" if kind.limit > kind.new else "below"}
        likes = [stranger(kind, rng) for _ in range(FLEET)]
        lives = np.array([one.life for one in likes])
        with Told([past(one, kind.limit) for one in likes], **rule) as fleet, Told(**rule) as alone:
            for _ in range(EACH):
                one = stranger(kind, rng)
                for cut in CUTS:
                    found["alone"].append(told(alone, one, cut, lives))
                    found["fleet"].append(told(fleet, one, cut, lives))
    return found


def past(one: Stranger, limit: float) -> Columns:
    """A like machine until its end, and three values beyond it."""
    step = one.life / len(one.at)
    at = np.r_[one.at, one.life + step * np.arange(1, 4)]
    return {"cycle": at, "wear": np.r_[one.value, np.full(3, limit + (limit - one.value[0]) / 20)]}


def line(name: str, found: Sequence[Row]) -> dict[float, tuple[float, float]]:
    """Prints one line a cut; (answered, held) by cut."""
    out = {}
    for cut in CUTS:
        asked = [row for row in found if row.cut == cut]
        good = [row for row in asked if row.answered]
        n = max(len(good), 1)
        held = sum(row.held for row in good) / n
        dummies = np.mean([row.dummies for row in good], axis=0) if good else np.full(3, np.nan)
        out[cut] = (len(good) / max(len(asked), 1), held)
        print(
            f"{name:18s} {cut:4.0%}  answered {len(good) / max(len(asked), 1):4.0%} of {len(asked)}"
            f"  80 %: {held:4.0%}  above the lower end {sum(r.above for r in good) / n:4.0%}  CRPS "
            f"{np.mean([r.score for r in good]) if good else np.nan:.3f} (mean {dummies[0]:.3f}, "
            f"lives {dummies[1]:.3f}, zero {dummies[2]:.3f})  alarms too early "
            f"{sum(r.early for r in good)}"
        )
    sys.stdout.flush()
    return out


def every(count: int, seed: int) -> dict[str, bool]:
    """All strangers; what is asked of them together."""
    whole: dict[str, list[Row]] = {"alone": [], "fleet": []}
    for law in LAWS:
        for kind, found in strangers(law, count, seed).items():
            whole[kind] += found
            line(f"{law} {kind}", found)
    alone, fleet = (line(f"all {kind}", whole[kind]) for kind in ("alone", "fleet"))
    answered = [row for row in whole["alone"] if row.answered]
    early = sum(row.early for row in answered) / max(len(answered), 1)
    return {
        "alone: 80 % hold 70 %": all(held >= 0.7 for _, held in alone.values()),
        "alone: answered in 60 % at 70 % and 90 % at 90 %": alone[0.7][0] >= 0.6
        and alone[0.9][0] >= 0.9,
        "alone: at most 5 % of alarms too early": early <= 0.05,
        "with a fleet: 80 % hold 75 %": all(held >= 0.75 for _, held in fleet.values()),
    }


def channels(name: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(hours, values by channel) of a rig."""
    table = rows(name)
    when = [datetime.strptime(row["Datetime"], "%Y.%m.%d.%H.%M.%S") for row in table]
    hours = np.array([(one - when[0]).total_seconds() / 3600.0 for one in when])
    names = [key for key in table[0] if key.startswith("Bearing")]
    return hours, {key: np.array([float(row[key]) for row in table]) for key in names}


RIGS = {
    "bearing_ims1/1st_test_resmaple_10minutes.csv": (
        "Bearing 3-A", "Bearing 3-B", "Bearing 4-A", "Bearing 4-B",
    ),
    "bearing_ims2/2nd_test_resmaple_10minutes.csv": ("Bearing 1",),
}  # fmt: skip
"""The channels of bearings that failed."""


def bearings() -> dict[str, bool]:
    """Every channel of both rigs, asked every 4 h."""
    false, late = 0, 0
    for name, failed in RIGS.items():
        soon: dict[str, bool] = {}
        hours, values = channels(name)
        for key, value in values.items():
            running = int(np.flatnonzero(value > 0.02)[-1]) + 1  # the rig stopped before its rows
            at, wear = hours[:running], value[:running]
            warned, lives = asked(at, wear)
            before = peer(at, wear)
            stop = float(at[-1])
            spoken = ", ".join(f"{x:.0f} h" for x in warned) or "never"
            print(f"{name[:12]} {key:12s} warned {spoken} before the stop; peer "
                  f"{f'{before:.0f} h' if before else 'never'}; lives held {sum(lives)} of "
                  f"{len(lives)}; rig ran {stop:.0f} h")  # fmt: skip
            false += key not in failed and any(x > HEALTHY for x in warned)
            soon[key.split("-")[0]] = soon.get(key.split("-")[0], key not in failed) or any(
                x >= 40.0 for x in warned
            )
        late += sum(not warned_in_time for warned_in_time in soon.values())
    return {"no healthy bearing warned": false == 0, "failing ones warned 40 h before": late == 0}


def asked(at: np.ndarray, wear: np.ndarray) -> tuple[list[float], list[bool]]:
    """(hours before the stop at which a warning was given, held intervals a day apart)."""
    limit = 3.0 * float(np.median(wear[at < 24.0]))
    beyond = np.convolve(wear > limit, np.ones(3), "valid") >= 3
    end = float(at[int(np.argmax(beyond))]) if beyond.any() else np.inf
    given, held, standing = [], [], False
    with Told(clock="h", limit=limit) as twin:
        for now in np.arange(8.0, min(end, float(at[-1])), 4.0):
            one = twin.component(until({"h": at, "wear": wear}, float(now), "h"))
            if one.life.onset is not None and not standing:
                given.append(float(at[-1]) - now)
            standing = one.life.onset is not None
            if isinstance(one.life, Life) and now % 24.0 == 0.0:
                low, high = one.life.interval80
                truth = end - now
                held.append(low <= truth <= high if np.isfinite(end) else high >= at[-1] - now)
    return given, held


def peer(at: np.ndarray, wear: np.ndarray) -> float | None:
    """Hours before the stop at which the peer warns."""
    base = 1.3 * float(np.median(wear[at <= 48.0]))
    for k in range(12, len(wear)):
        if float(np.median(wear[k - 12 : k])) > base and at[k] > 48.0:
            return float(at[-1] - at[k])
    return None


def cells(draws: int) -> dict[str, bool]:
    """Cells of one batch: 30 as fleet, 13 told, drawn anew each time."""
    table = rows("battery_fleet/capacity.csv")
    known: dict[str, Columns] = {}
    for name in dict.fromkeys(row["cell"] for row in table):
        own = [row for row in table if row["cell"] == name]
        known[name] = {"cycle": np.array([float(r["cycle"]) for r in own]),
                       "wear": np.array([float(r["capacity_Ah"]) for r in own])}  # fmt: skip
    ends = {name: over(one) for name, one in known.items()}
    found: dict[str, list[Row]] = {"alone": [], "fleet": []}
    rule = {"limit": 0.93, "direction": "below"}
    for draw in range(draws):
        order = np.random.default_rng(draw).permutation(list(known)).tolist()
        lives = np.array([end for name in order[:30] if (end := ends[name]) is not None])
        with Told([known[n] for n in order[:30]], **rule) as fleet, Told(**rule) as alone:
            for name in order[30:]:
                end = ends[name]
                if end is None:
                    continue
                for cut in CUTS:
                    now = np.floor(cut * end)
                    part = until(known[name], float(now))
                    for kind, twin in (("alone", alone), ("fleet", fleet)):
                        found[kind].append(scored(twin.component(part), cut, end - now, end, lives))
    alone, fleet = (line(f"cells {kind}", found[kind]) for kind in ("alone", "fleet"))
    return {
        "cells alone: 80 % hold 70 %": all(held >= 0.7 for n, held in alone.values() if n),
        "cells with a fleet: 80 % hold 75 %": all(held >= 0.75 for _, held in fleet.values()),
    }


def over(one: Columns) -> float | None:
    """The cycle from which three values lie below the limit; None: censored."""
    below = np.convolve(one["wear"] < 0.93, np.ones(3), "valid") >= 3
    return float(one["cycle"][int(np.argmax(below))]) if below.any() else None


def main() -> int:
    """Prints the counts; exit code 1 if a demand is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=100)
    parser.add_argument("--only", choices=("strangers", "bearings", "cells"))
    parser.add_argument("--draws", type=int, default=2, help="of the cells' fleet")
    parser.add_argument("--seed", type=int, default=3)
    told = parser.parse_args()
    demands: dict[str, bool] = {}
    if told.only in (None, "strangers"):
        demands |= every(told.series, told.seed)
    if "EVERTWIN_DATA" in os.environ and told.only in (None, "bearings"):
        demands |= bearings()
    if "EVERTWIN_DATA" in os.environ and told.only in (None, "cells"):
        demands |= cells(told.draws)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
