"""A real arm that does not wear: `python -m proofs.unworn`.

Needs EVERTWIN_DATA. `twins/ur10e.toml` with one store is commissioned on the recordings of 5 and 6
February 2020; the others of that month, then those of autumn 2019, are run one by one. Each joint
has an indicator, its friction at 0.5 rad/s, with a limit of 1.5 times what was commissioned, and
`Twin.life` is asked after every run. Nothing wore: neither a life nor an alarm is right.
"""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import replace

from evertwin import Twin
from evertwin.config.spec import IndicatorSpec, PrognosisSpec, StoreSpec
from evertwin.prognosis.laws import Indicator, Life
from planted.twins import shipped
from proofs._verdict import ended, no_data
from proofs.seasons import COMMISSIONED, date, files

LIMIT, SPEED = 1.5, 0.5
"""Share of the friction when commissioned, at this speed [rad/s]."""


def newest(told: Indicator) -> str:
    """The newest value with its standard deviation; nothing where none could be told yet."""
    return f"{told.value[-1]:.2f}±{told.sigma[-1]:.2f}" if len(told.value) else "-"


def main() -> int:
    """Prints what is told of each joint after each run; exit code 1 if any life or alarm is."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    known = files("identification")
    start = [file for file in known if date(file) in COMMISSIONED]
    rest = [file for file in known if file not in start] + files("autumn")
    lives = alarms = 0
    with tempfile.TemporaryDirectory() as folder:
        spec = replace(shipped("ur10e"), store=StoreSpec(path=f"{folder}/arm.db"))
        with Twin(spec) as twin:
            version = twin.keep(twin.fit(start))
            twin.promote(version.number, "commissioned")
            p = dict(zip(twin.champion.names, version.p.tolist(), strict=True))
        rules = tuple(
            IndicatorSpec(
                f"friction{k}", component=f"joint{k}", formula=f"Fc{k} + {SPEED} * Fv{k}",
                limit=LIMIT * (p[f"Fc{k}"] + SPEED * p[f"Fv{k}"]),
            )
            for k in range(1, 7)
        )  # fmt: skip
        spec = replace(spec, indicator=rules, prognosis=PrognosisSpec(clock="run"))
        for file in rest:
            with Twin(spec) as twin:
                twin.run([file])
                found = twin.life()
            told = {n: c for n, c in found.components.items() if isinstance(c.life, Life)}
            lives, alarms = lives + len(told), alarms + len(found.alarms) + len(found.held)
            values = " ".join(newest(one.indicator) for one in found.components.values())
            said = "; ".join(f"{n} {one.sentence}" for n, one in told.items()) or "no life"
            raised = "; ".join(f"{one.kind} {one.component}: {one.reason}" for one in found.alarms)
            print(f"{file.stem:26} {values}  {raised or 'no alarm'}  {said}", flush=True)
    print(f"{lives} lives and {alarms} alarms in {6 * len(rest)} answers")
    return ended({"no life": lives == 0, "no alarm": alarms == 0})


if __name__ == "__main__":
    sys.exit(main())
