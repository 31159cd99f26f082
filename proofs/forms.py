"""The form of static maps: `python -m proofs.forms [planted|tx40 ...] [SEEDS]`.

planted: an arm whose joints rub, pull and hang in ways that the twin is not told, in other formulas
than the library's (`planted.rubbing`). SEEDS machines (50): causes are drawn for four joints, one
joint does what no cause explains, one is as described. `Twin.fit` on `twins/arm.toml` with every
term in the ladder, three runs of 20 s, judged on a fourth: is the cause named, and only it; what is
left on unseen rows, in parts of the noise; is the strange joint's form said to be unknown?

tx40 (needs EVERTWIN_DATA): a real Stäubli TX40 (9 s), `twins/tx40.toml`, first half → second half,
in percent of the joint's torque over all rows; then friction of the whole record by the sign law of
the data's own reference, against that reference.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from evertwin import FitResult
from planted.rubbing import CAUSES, NOISE, Extra, recording, strange
from planted.twins import opened, shipped
from proofs._verdict import ended, no_data

RUNS, SECONDS = 3, 20.0
LADDER = ("load", "root", "stribeck", "direction", "position", "spring", "balance")
TUNED = ("Ia*", "Fv*", "Fc*", "offset*", "Fs*", "Fr*", "Fl*", "Fq*", "Ks*", "Gc*", "Gs*")
HEAVY = (1, 2, 3)
"""Joints that carry enough for a friction by load to act."""
ASKED = (9.0, 12.0, 13.0, 11.0, 25.0, 30.0)
"""Percent of the torque, joint by joint: plain least squares on the same halves."""
REFERENCE = {
    "Fv": (8.05, 5.53, 1.97, 1.11, 1.86, 0.65), "Fc": (7.14, 8.26, 6.34, 2.48, 3.03, 0.282),
}  # fmt: skip
SHAFT = {"Fv_m6": 0.616, "Fc_m6": 1.95}


def drawn(seed: int) -> tuple[dict[int, str], int]:
    """Causes by joint, and the joint that does what no cause explains."""
    rng = np.random.default_rng(seed)
    joints, causes = rng.permutation(6).tolist(), rng.permutation(list(CAUSES)).tolist()
    odd, chosen = joints[0], dict[int, str]()
    for joint in joints[1:5]:
        cause = next(c for c in causes if c != "load" or joint in HEAVY)
        causes.remove(cause)
        chosen[joint] = cause
    return chosen, odd


def learned(seed: int, planted: Mapping[int, Extra], ladder: tuple[str, ...]) -> FitResult:
    """The twin, tuned on runs of one machine and judged on another run of it."""
    law = "+".join(("tanh", *ladder))
    runs = [recording(10 * seed + k, SECONDS, planted) for k in range(RUNS)]
    rows = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
    rows["t"] += np.repeat(np.arange(RUNS) * (SECONDS + 5.0), len(runs[0]["t"]))
    model = {"options": {**shipped("arm").model.options, "law": law}}
    names = TUNED if ladder else TUNED[:4]
    with opened("arm", model=model, tuning={"ladder": ladder, "editable": names}) as twin:
        return twin.fit(rows, [recording(10 * seed + RUNS, SECONDS, planted)])


def planted(seeds: int) -> dict[str, bool]:
    """The first part."""
    print(f"planted: {seeds} arms, four causes each, a strange joint, a plain one")
    named, more, unknown, cried = dict.fromkeys(CAUSES, 0), 0, 0, 0
    count, before, after = dict.fromkeys(CAUSES, 0), list[float](), list[float]()
    for seed in range(seeds):
        causes, odd = drawn(seed)
        extras = {joint: CAUSES[cause] for joint, cause in causes.items()} | {odd: strange}
        plain, full = (learned(seed, extras, ladder) for ladder in ((), LADDER))
        for joint, law in enumerate(full.laws.values()):
            terms = law.split("+")[1:]
            if joint in causes:
                count[causes[joint]] += 1
                named[causes[joint]] += causes[joint] in terms
                before.append(plain.test[joint].rms / NOISE[joint])
                after.append(full.test[joint].rms / NOISE[joint])
            more += joint != odd and bool(set(terms) - {causes.get(joint)})
        unknown += bool(full.unknown)
        del extras[odd]
        cried += bool(learned(seed, extras, LADDER).unknown)
    for cause in CAUSES:
        print(f"   {cause:10} named on {named[cause]} of {count[cause]} joints")
    total = sum(count.values())
    print(f"   another term beside or instead: {more} of {5 * seeds} joints")
    print(
        f"   form of the strange joint said to be unknown: {unknown} of {seeds}; "
        f"without it: {cried}"
    )
    print(
        f"   unseen rows, in parts of the noise: {np.median(before):.2f} without terms -> "
        f"{np.median(after):.2f} (95 % below {np.quantile(after, 0.95):.2f}); worse on "
        f"{sum(a > b for a, b in zip(after, before, strict=True))} of {total} joints"
    )
    return {
        "causes named in 95 %": sum(named.values()) >= 0.95 * total,
        "unknown said in 95 %": unknown >= 0.95 * seeds,
        "and in 5 % where it is known": cried <= 0.05 * seeds,
        "nothing worse on unseen rows": all(a <= b for a, b in zip(after, before, strict=True)),
    }


def halves(part: str) -> list[str]:
    """Both files of the arm, or a part of them."""
    folder = Path(os.environ["EVERTWIN_DATA"]) / "staubli_tx40"
    return [f"{folder / name}.csv{part}" for name in ("pos_read_data", "curr_data")]


def tx40() -> dict[str, bool]:
    """The second part."""
    with opened("tx40") as twin:
        result = twin.fit(halves("@:4.5"), [halves("@4.5:")])
    print("tx40: first half -> second half, % of the torque, all rows (moving rows)")
    for deviation, (joint, law), asked in zip(result.test, result.laws.items(), ASKED, strict=True):
        all_rows, moving = 100 * deviation.relative_rms, 100 * deviation.relative_rms_moving
        cause = result.causes.get(joint, "")
        print(
            f"   {joint} {all_rows:5.1f} (asked {asked:.0f}; moving {moving:.1f})  {law}: {cause}"
        )
    good = all(100 * d.relative_rms <= asked for d, asked in zip(result.test, ASKED, strict=True))
    return {"six joints as documented": good, "friction within 5 %": reference()}


def reference() -> bool:
    """Friction of the whole record; the reference counts joint 5 and 6 with the motor's share."""
    # below 0.02 rad/s the encoder's steps decide on the sign of the speed
    options = {**shipped("tx40").model.options, "law": "sign", "standstill": 0.02}
    names = ("Ia*", "Fv*", "Fc*", "offset*", "link_*")
    tuning = {"ladder": ("shaft",), "editable": names}
    with opened("tx40", model={"options": options}, tuning=tuning, moving={"tune": True}) as twin:
        fit = twin.fit(halves("")).fit
    print("   friction of the whole record, sign law, against the published values")
    good = True
    for kind, values in REFERENCE.items():
        shares = []
        for joint, value in enumerate(values, start=1):
            own = fit[f"{kind}{joint}"] + (fit["Fv_m6"] if kind == "Fv" and joint > 4 else 0.0)
            shares.append(100 * (own / value - 1.0))
            low, high = fit.interval(f"{kind}{joint}")
            good &= abs(shares[-1]) <= 5.0 or high - low > 0.5 * value
        print(f"   {kind}1-6: " + " ".join(f"{share:+.1f} %" for share in shares))
    shares = [100 * (fit[name] / value - 1.0) for name, value in SHAFT.items()]
    print(f"   motor 6, Fv and Fc: {shares[0]:+.1f} % {shares[1]:+.1f} %")
    return good


PARTS: Mapping[str, Callable[[int], dict[str, bool]]] = {
    "planted": planted, "tx40": lambda _: tx40(),
}  # fmt: skip


def main() -> int:
    """Prints all parts, or those asked for."""
    seeds = next((int(one) for one in sys.argv[1:] if one.isdigit()), 50)
    chosen = [one for one in sys.argv[1:] if not one.isdigit()] or list(PARTS)
    if "tx40" in chosen and "EVERTWIN_DATA" not in os.environ:
        return no_data()
    asked: dict[str, bool] = {}
    for name in chosen:
        asked |= PARTS[name](seeds)
    return ended(asked)


if __name__ == "__main__":
    sys.exit(main())
