"""The real arm: `python -m proofs.ur10e [PART ...]` (needs EVERTWIN_DATA).

`Twin.fit` on `twins/ur10e.toml`: trained on some recordings, judged on others. A figure is
rms(measured − predicted) / rms(measured) of a joint in percent, torques filtered at 5 Hz; "all":
all rows, "moving": rows on which the joint is faster than 0.05 rad/s.

1. The sign law, trained on the 30 s run of 10 February and the 50 s run of 12 February.
2. The law that the ladder chooses on the runs before 19 February, on the run of 19 February.
3. Every day left out in turn: fixed, and with friction re-tuned in the stream (predict 1 s, learn).
4. The same motion without and with a load: what explains the deviation, and the load's mass.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from fnmatch import fnmatch
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import FitResult
from evertwin.models.spec import ParameterSpec
from evertwin.setup.evaluation import Deviation
from planted.twins import opened, shipped
from proofs._verdict import no_data

LAST = "ur-20_02_19_14harm50sec"
PAIR = ("ur-20_02_10-30sec_12harm", "ur-20_02_12-50sec_12harm")
REFERENCE = {
    LAST: (10.5, 4.5, 4.3, 11.3, 17.1, 12.7),
    "ur-20_02_12-40sec_12harm": (10.1, 4.2, 4.8, 8.7, 12.8, 12.8),
}
FRICTION = ("F[vcsrl]*", "offset*")


def files(*folders: str) -> list[Path]:
    """Recordings, by name."""
    base = Path(os.environ["EVERTWIN_DATA"]) / "ur10e"
    return sorted(path for folder in folders for path in (base / folder).glob("*.csv"))


def day(file: Path) -> str:
    """Month and day of a run, from its name."""
    return file.stem[6:11]


def fitted(train: Sequence[Path], test: Sequence[Path] = (), **sections: Any) -> FitResult:
    """The arm, tuned and judged; nothing is followed unless asked."""
    sections["tuning"] = {"method": "auto", **sections.get("tuning", {})}
    with opened("ur10e", **sections) as twin:
        return twin.fit(list(train), list(test))


def options(**changes: Any) -> dict[str, Any]:
    """The model with other options."""
    return {"options": {**shipped("ur10e").model.options, **changes}}


def show(found: Sequence[Deviation], least: int = 0) -> str:
    """All rows and moving rows; a joint with fewer moving rows than asked has no figure."""
    moving = [d.relative_rms_moving if d.moving >= least else np.nan for d in found]
    rows = ([d.relative_rms for d in found], moving)
    every, some = (" ".join(f"{100 * v:5.1f}" if v == v else "    –" for v in row) for row in rows)
    return f"{some}" if least else f"all {every} | moving {some}"


def sign_law() -> None:
    """Part 1."""
    print("1. sign law, trained on the 30 s run of 10 Feb and the 50 s run of 12 Feb")
    known = files("identification")
    plain = {
        "ladder": (),
        "causes": {},
        "states": {},
        "editable": ("Ia*", "Fv*", "Fc*", "offset*", "*_link.*"),
    }
    train = [file for file in known if file.stem in PAIR]
    test = [file for file in known if file.stem not in PAIR]
    result = fitted(train, test, model=options(law="sign"), tuning=plain)
    for file, (_, found) in zip(test, result.tests, strict=True):
        print(f"   {file.stem:26} {show(found)}")
        if file.stem in REFERENCE:
            print(f"   {'reference':26} all " + " ".join(f"{v:5.1f}" for v in REFERENCE[file.stem]))


def chosen_law() -> None:
    """Part 2."""
    print("2. law chosen on the runs before 19 Feb (each run held out in turn)")
    known = files("identification")
    train = [file for file in known if file.stem != LAST]
    result = fitted(train, [file for file in known if file.stem == LAST])
    print("   chosen: " + ", ".join(result.laws.values()))
    print(f"   {LAST:26} {show(result.test)}")


def leave_one_day_out() -> None:
    """Part 3. The law is chosen anew without the day that is left out."""
    print("3. leave one day out, moving rows: fixed model | friction re-tuned every second")
    print("   (joints with at least 300 moving rows)")
    known = files("identification")
    judged = files("identification", "jointwise")
    judged += [file for file in files("load_pair") if "unload" in file.stem]
    stream = {"method": "recursive", "follow": FRICTION}
    worst = np.zeros(6)
    for today, group in groupby(sorted(judged, key=day), key=day):
        test = list(group)
        train = [file for file in known if day(file) != today]
        fixed, tuned = fitted(train, test), fitted(train, test, tuning=stream)
        for file, (_, a), (_, b) in zip(test, fixed.tests, tuned.tests, strict=True):
            print(f"   {file.stem:26} {show(a, 300)} | {show(b, 300)}", flush=True)
            seen = [100 * d.relative_rms_moving if d.moving >= 300 else 0.0 for d in b]
            worst = np.fmax(worst, seen)
    print(f"   {'worst':26} {'':35} | " + " ".join(f"{v:5.1f}" for v in worst))


def load_pair() -> None:
    """Part 4. Each cause alone is tuned on the run, from the values of all the others."""
    print("4. share of the squared deviation that each cause explains, in units of the noise")
    trained = fitted(files("identification"))
    values = {item.name: ParameterSpec(value=item.value) for item in trained.parameters}
    model = {"parameters": values}
    taken = [name for name in trained.fit.names if trained.fit[name] != 0.0]
    friction = tuple(n for n in taken if any(fnmatch(n, pattern) for pattern in FRICTION))
    causes = {"friction": friction, "load": shipped("ur10e").tuning.causes["load"]}
    for file in files("load_pair"):
        said = []
        for cause, names in causes.items():
            fit = fitted([file], model=model, tuning={"editable": names, "ladder": ()}).fit
            rms = [(r.rms_before, r.rms_after) for r in fit.residuals]
            before, after = np.square(np.array(rms) / trained.fit.noise[:, None]).mean(axis=0)
            said.append(f"{cause} {1.0 - after / before:.2f}")
        low, high = fit.interval("payload.m")
        print(
            f"   {file.stem:26} deviation {np.sqrt(before):5.1f} x the training residual | "
            f"{', '.join(said)} | mass {fit['payload.m']:.2f} kg [{low:.2f}, {high:.2f}]"
        )


PARTS: tuple[Callable[[], None], ...] = (sign_law, chosen_law, leave_one_day_out, load_pair)


def main() -> int:
    """Prints all parts, or those asked for."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    for number, part in enumerate(PARTS, start=1):
        if len(sys.argv) == 1 or str(number) in sys.argv[1:]:
            part()
    return 0


if __name__ == "__main__":
    sys.exit(main())
