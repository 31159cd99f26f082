"""All proofs, one after the other: `python -m proofs [NAME ...]`.

Each is a module of this folder that prints its figures; it runs alone as `python -m proofs.NAME`.
A proof that ends with another exit code than 0 fails the run, also one that has no recordings.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from proofs._verdict import NO_DATA

HERE = Path(__file__).parent
ENDS = {0: "reached", 1: "MISSED or broken off", NO_DATA: "no recordings"}


def main(names: list[str]) -> int:
    """Exit code 0 if every proof ends with 0."""
    found = sorted(path.stem for path in HERE.glob("*.py") if not path.stem.startswith("_"))
    failed = []
    for name in names or found:
        start = time.monotonic()
        sys.stdout.write(f"== {name}\n")
        sys.stdout.flush()
        done = subprocess.run(
            [sys.executable, "-m", f"proofs.{name}"], cwd=HERE.parent, check=False
        )
        failed += [name] if done.returncode else []
        end = ENDS.get(done.returncode, f"exit {done.returncode}")
        sys.stdout.write(f"== {name}: {time.monotonic() - start:.0f} s, {end}\n")
    sys.stdout.write(
        f"proofs: {len(names or found) - len(failed)} ok, failed: {failed or 'none'}\n"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
