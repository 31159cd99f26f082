"""Lives on wear that no law here is like, and on real machines: `python -m proofs.believed [N]`.

`Twin.life` on `twins/wear.toml`, nothing set.

1. *Strangers*: N (100 by default) series of each law of `planted/fresh.py` (``--laws abrupt``: the
   abrupt ones of `planted/sudden.py`; ``drawn``: `planted/unlike.py` and `planted/unseen.py`,
   ``uneven``: `planted/uneven.py`, which widths alone were measured on), at 30, 50, 70 and 90 % of
   their lives, alone and with a fleet of 16 like machines (``--shifted``: also with one whose lives
   are half or twice as long). Counted: answers, how many 80 % intervals hold the truth, how many
   truths lie above the lower end, and the CRPS (in whole lives) beside dummies at these moments:
   mean life less age, the fleet's lives beyond this age, how long like machines still lasted
   at this level, always 0. `failure_due` with more than 5 times its lead left is counted.
2. *Bearings* (needs EVERTWIN_DATA): every channel of `bearing_ims1` and `bearing_ims2`, asked every
   4 h; the limit is three times the median of the first day. A channel is healthy until 12 h before
   its rig stops. The peer warns at a median of 12 values over 1.3 times that of the first 48 h.
   Those that failed and passed the limit are asked at `LATE`, too, where the lower end counts.
   `bearing_femto`: a limit of 20 g, each with the five others, which failed with their last row.
3. *Cells*: 13 of `battery_fleet`, 30 others as fleet, ends at 0.93 Ah; each cell alone; `battery`
   alone.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from evertwin.prognosis.laws import Life
from planted.fresh import FRESH
from planted.histories import Columns, Told, until
from planted.sudden import ABRUPT
from planted.uneven import UNEVEN
from planted.unlike import LEVELS as LAWS
from planted.unlike import Stranger, kind_of, stranger
from planted.unseen import UNSEEN
from proofs._believed import CUTS, Likes, Row, line, scored
from proofs._verdict import ended
from proofs.series import rows

FLEET = 16
EACH = 4
"""Strangers that share a fleet."""
HEALTHY = 12.0
LATE = (26.0, 24.0, 22.0, 5.0, 4.0, 3.0)
"""Hours before the end at which the lower end is asked."""
EVERY = (*LAWS, *UNSEEN, *FRESH, *ABRUPT, *UNEVEN)


def strangers(law: str, told: tuple[int, int, bool]) -> dict[str, list[Row]]:
    """All questions about one law; ``told``: series, seed, and whether fleets are shifted too."""
    count, seed, shifted = told
    kinds = {"alone": 0.0, "fleet": 1.0} | ({"x 0.5": 0.5, "x 2": 2.0} if shifted else {})
    found: dict[str, list[Row]] = {kind: [] for kind in kinds}
    for k in range(-(-count // EACH)):
        rng = np.random.default_rng([seed, EVERY.index(law), k])
        kind = kind_of(law, rng)
        rule: dict[str, Any] = {
            "limit": kind.limit,
            "direction": "above" if kind.limit > kind.new else "below",
        }
        likes = [stranger(kind, rng) for _ in range(FLEET)]
        ones = [stranger(kind, rng) for _ in range(EACH)]
        for name, pace in kinds.items():
            fleet = [past(one, kind.limit, pace) for one in likes] if pace else []
            knows = Likes(
                np.array([one.life for one in likes]) * (pace or 1.0),
                [(one.at * (pace or 1.0), one.value) for one in likes],
            )
            with Told(fleet, **rule) as twin:
                for one, cut in itertools.product(ones, CUTS):
                    known = until({"cycle": one.at, "wear": one.value}, cut * one.life)
                    left = one.life - float(known["cycle"][-1])
                    answer = twin.component(known)
                    found[name].append(scored(answer, cut, left, one.life, knows))
    return found


def past(one: Stranger, limit: float, pace: float) -> Columns:
    """A like machine until its end, and three values beyond it; ``pace``: of its life."""
    step = one.life / len(one.at)
    at = np.r_[one.at, one.life + step * np.arange(1, 4)] * pace
    return {"cycle": at, "wear": np.r_[one.value, np.full(3, limit + (limit - one.value[0]) / 20)]}


def every(laws: Sequence[str], told: tuple[int, int, bool]) -> dict[str, bool]:
    """All strangers; what is asked of them together."""
    whole: dict[str, list[Row]] = {}
    for law in laws:
        for kind, found in strangers(law, told).items():
            whole.setdefault(kind, []).extend(found)
            line(f"{law} {kind}", found)
    every = {kind: line(f"all {kind}", found) for kind, found in whole.items()}
    alone, fleet = every["alone"], every["fleet"]
    answered = [row for kind in ("alone", "fleet") for row in whole[kind] if row.answered]
    early = sum(row.early for row in answered) / max(sum(row.due for row in answered), 1)
    narrow = [row.held for row in answered if row.narrow]
    sure = float(np.mean(narrow)) if narrow else 1.0
    print(f"answers narrower than 5 : 1: {len(narrow)}, {sure:.0%} hold; alarms too early "
          f"{early:.1%}")  # fmt: skip
    late = [cut for cut in CUTS if cut >= 0.5]
    shifted = [one for kind, cuts in every.items() if kind[0] == "x" for one in cuts.values()]
    return {
        "alone: 80 % hold 70 %": all(one.held >= 0.7 for one in alone.values()),
        "alone: answered in 60 % at 70 % and 90 % at 90 %": alone[0.7].answered >= 0.6
        and alone[0.9].answered >= 0.9,
        "alone: loss below the best dummy's from 50 % on": all(
            alone[cut].loss < alone[cut].best for cut in late
        ),
        "with a fleet: 80 % hold 75 to 88 %": all(one.meets(0.75, 0.88) for one in fleet.values()),
        "with a fleet: loss below the best dummy's from 50 % on": all(
            fleet[cut].loss < fleet[cut].best for cut in late
        ),
        "narrower than 5 : 1: 75 % hold": sure >= 0.75,
        "at most 5 % of alarms too early": early <= 0.05,
    } | ({"a shifted fleet: 80 % hold 70 %": all(one.held >= 0.7 for one in shifted)}
         if shifted else {})  # fmt: skip


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
    low: list[bool] = []
    for name, failed in RIGS.items():
        soon: dict[str, bool] = {}
        hours, values = channels(name)
        for key, value in values.items():
            running = int(np.flatnonzero(value > 0.02)[-1]) + 1  # the rig stopped before its rows
            at, wear = hours[:running], value[:running]
            warned, lives, lower = asked(at, wear)
            low += lower if key in failed else []
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
    print(f"lower end below the truth in {sum(low)} of {len(low)} late answers")
    return {
        "no healthy bearing warned": false == 0, "failing ones warned 40 h before": late == 0,
        "lower end below the truth in 90 % of late answers": sum(low) >= 0.9 * len(low),
    }  # fmt: skip


def asked(at: np.ndarray, wear: np.ndarray) -> tuple[list[float], list[bool], list[bool]]:
    """(hours before the stop at which a warning was given, held intervals a day apart, whether the
    lower ends at `LATE` lie below the truth)."""
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
        lives = [
            (left, twin.life(until({"h": at, "wear": wear}, end - left, "h")))
            for left in LATE
            if np.isfinite(end)
        ]
    lower = [one.interval80[0] <= left for left, one in lives if isinstance(one, Life)]
    return given, held, lower


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
    known = by_name(table, "cell")
    ends = {name: over(one, 0.93) for name, one in known.items()}
    found: dict[str, list[Row]] = {"alone": [], "fleet": []}
    rule: dict[str, Any] = {"limit": 0.93, "direction": "below"}
    for draw in range(draws):
        order = np.random.default_rng(draw).permutation(list(known)).tolist()
        ended = {name: end for name in order[:30] if (end := ends[name]) is not None}
        ways = [(known[name]["cycle"], known[name]["wear"]) for name in ended]
        likes = Likes(np.array(list(ended.values())), ways)
        with Told([known[n] for n in order[:30]], **rule) as fleet, Told(**rule) as alone:
            for name in order[30:]:
                found["fleet"] += asked_of(fleet, known[name], ends[name], likes)
            for name in order if draw == 0 else ():
                found["alone"] += asked_of(alone, known[name], ends[name], likes)
    every = {kind: line(f"cells {kind}", found[kind]) for kind in found}
    late = [cut for cut in CUTS if cut >= 0.5]
    return {
        "cells alone: 80 % hold 70 %": all(c.held >= 0.7 for c in every["alone"].values()),
        "cells with a fleet: 80 % hold 75 to 88 %": all(
            c.meets(0.75, 0.88) for c in every["fleet"].values()
        ),
        "cells with a fleet: loss below the best dummy's": all(
            every["fleet"][cut].loss < every["fleet"][cut].best for cut in late
        ),
    } | two()


def two() -> dict[str, bool]:
    """The two cells of `battery` alone; B0007 never falls below 1.4 Ah."""
    known = by_name(rows("battery/capacity.csv"), "battery")
    with Told(limit=1.4, direction="below") as alone:
        end = over(known["B0005"], 1.4)
        found = asked_of(alone, known["B0005"], end, Likes(np.array([167.0])))
        whole = alone.component(known["B0007"]).life
    line("B0005 alone", found)
    said = f"{whole.median:.0f} cycles, 80 % {whole.interval80}" if isinstance(whole, Life) else ""
    print(f"B0007 at its end, above the limit: {said or 'not enough data'}")
    return {"battery alone: 80 % hold 70 %": float(np.mean([r.held for r in found])) >= 0.7}


def asked_of(twin: Told, one: Columns, end: float | None, likes: Likes) -> list[Row]:
    """One cell at all cuts."""
    if end is None:
        return []
    moments = [(cut, float(np.floor(cut * end))) for cut in CUTS]
    return [
        scored(twin.component(until(one, now)), cut, end - now, end, likes) for cut, now in moments
    ]


def by_name(table: Sequence[Mapping[str, str]], key: str) -> dict[str, Columns]:
    """Series of capacity by name."""
    known: dict[str, Columns] = {}
    for name in dict.fromkeys(row[key] for row in table):
        own = [row for row in table if row[key] == name]
        known[name] = {"cycle": np.array([float(r["cycle"]) for r in own]),
                       "wear": np.array([float(r["capacity_Ah"]) for r in own])}  # fmt: skip
    return known


def over(one: Columns, limit: float) -> float | None:
    """The cycle from which three values lie below the limit; None: censored."""
    below = np.convolve(one["wear"] < limit, np.ones(3), "valid") >= 3
    return float(one["cycle"][int(np.argmax(below))]) if below.any() else None


def femto() -> dict[str, bool]:
    """Six bearings to their end, each with the five others, which failed with their last row."""
    names = [f"{k}_{m}" for k in (1, 2, 3) for m in (1, 2)]
    known: dict[str, Columns] = {}
    for name in names:
        table = rows(f"bearing_femto/Bearing{name}.csv")
        known[name] = {"h": np.array([float(r["time_s"]) / 3600.0 for r in table]),
                       "wear": np.array([float(r["peak_h_g"]) for r in table])}  # fmt: skip
    lower = dict.fromkeys(CUTS, 0)
    sudden = 0
    for name in names:
        others = [known[n] for n in names if n != name]
        with Told(others, clock="h", failed=True, limit=20.0) as twin:
            for cut in CUTS:
                end = float(known[name]["h"][-1])
                one = twin.component(until(known[name], cut * end, "h"))
                life, told = one.life, "nothing: not enough data"
                if isinstance(life, Life):
                    lower[cut] += life.interval80[0] <= (1.0 - cut) * end
                    told = f"{life.interval80[0]:.2f} to {life.interval80[1]:.2f} h (80 %)"
                sudden += "without warning" in " ".join(one.fleet.told if one.fleet else ())
                print(f"bearing {name} {cut:4.0%}  {(1.0 - cut) * end:6.2f} h left, told {told}")
    return {
        "FEMTO: lower end below the truth in 5 of 6 at each cut": min(lower.values()) >= 5,
        "FEMTO: sudden ends said": sudden == len(names) * len(CUTS),
    }


def main() -> int:
    """Prints the counts; exit code 1 if a demand is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("series", nargs="?", type=int, default=100)
    parser.add_argument("--only", choices=("strangers", "bearings", "cells", "femto"))
    parser.add_argument("--draws", type=int, default=2, help="of the cells' fleet")
    parser.add_argument("--laws", default="fresh", help="fresh, drawn, uneven, abrupt, or one")
    parser.add_argument("--shifted", action="store_true", help="fleets of half and twice the life")
    parser.add_argument("--seed", type=int, default=3)
    told = parser.parse_args()
    demands: dict[str, bool] = {}
    if told.only in (None, "strangers"):
        known = {"fresh": tuple(FRESH), "drawn": (*LAWS, *UNSEEN), "abrupt": tuple(ABRUPT),
                 "uneven": tuple(UNEVEN)}  # fmt: skip
        laws = known.get(told.laws, (told.laws,))
        demands |= every(laws, (told.series, told.seed, told.shifted))
    if "EVERTWIN_DATA" in os.environ and told.only in (None, "bearings"):
        demands |= bearings()
    if "EVERTWIN_DATA" in os.environ and told.only in (None, "cells"):
        demands |= cells(told.draws)
    if "EVERTWIN_DATA" in os.environ and told.only in (None, "femto"):
        demands |= femto()
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
