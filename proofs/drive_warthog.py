"""A real skid-steered base: `python -m proofs.drive_warthog` (needs EVERTWIN_DATA).

Clearpath Warthog (Baril et al., arXiv:2309.10718), windows of 2 s at random wheel commands, with
`twins/drive_warthog.toml` as it is: steady windows, predicted from their start to their end.

1. `Twin.run` over all of them: what goes live.
2. `Twin.fit` on the even calibration steps, with the twin file's kinds of term, judged on the odd
   ones: what is found, and the rms of the way over a window, beside the model as configured.

Asked: a correction goes live, and on unseen steps it halves the deviation of the model as
configured.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from planted.twins import opened
from proofs._verdict import ended, no_data

SAID = ("corrected", "tuned", "promoted", "rejected", "rolled_back", "undecided")


def steps(file: Path, folder: Path, odd: int) -> Path:
    """The rows of even or of odd calibration steps."""
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    column = head.split(",").index("calib_step")
    kept = [row for row in rows if int(float(row.split(",")[column])) % 2 == odd]
    out = folder / f"steps{odd}.csv"
    out.write_text("\n".join([head, *kept]), encoding="utf-8")
    return out


def main() -> int:
    """Prints what was found; exit code 1 where nothing goes live, or too little is gained."""
    if "EVERTWIN_DATA" not in os.environ:
        return no_data()
    print("1. the whole recording, in the stream")
    with opened("drive_warthog") as twin:
        result = twin.run()
    for event in result.of_kind(*SAID):
        print(f"   row {event.row}: {event.kind}: {event.reason}")
    out = result.outputs["travel"]
    print(f"   way: rms {out.rms_before:.3f} -> {out.rms_after:.3f} m on unseen windows")
    print("2. fitted to the even steps, judged on the odd ones")
    file = Path(os.environ["EVERTWIN_DATA"]) / "drive_warthog" / "warthog_windows.csv"
    rms = {}
    with tempfile.TemporaryDirectory() as folder:
        train, test = (steps(file, Path(folder), odd) for odd in (0, 1))
        for name, found in (("as configured", False), ("with terms", True)):
            with opened("drive_warthog", correction={"in_fit": found}) as twin:
                fit = twin.fit([train], [test])
            rms[name] = next(d.rms for d in fit.test if d.name == "travel")
            print(f"   {name}: rms of the way {rms[name]:.3f} m")
            for said in fit.search.get("describes", ()):
                print(f"      {said}")
    return ended({
        "something went live": bool(result.of_kind("promoted")),
        "half the deviation on unseen steps": rms["with terms"] <= 0.5 * rms["as configured"],
    })  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
