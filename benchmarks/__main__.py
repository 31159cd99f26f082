"""All benchmarks, one after the other: `python -m benchmarks [NAME ...]`.

Each is a module of this folder that prints its figures, alone: `python -m benchmarks.NAME`.
They run in processes of their own with one thread each, so that none warms another's caches.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def main(names: list[str]) -> int:
    """Exit code 0 if every benchmark ends with 0."""
    found = sorted(path.stem for path in HERE.glob("*.py") if not path.stem.startswith("_"))
    single = os.environ | dict.fromkeys(THREADS, "1")
    failed = []
    for name in names or found:
        sys.stdout.write(f"== {name}\n")
        sys.stdout.flush()
        done = subprocess.run(
            [sys.executable, "-m", f"benchmarks.{name}"], cwd=HERE.parent, env=single, check=False
        )
        failed += [name] if done.returncode else []
    sys.stdout.write(f"benchmarks: {len(names or found)} run, failed: {failed or 'none'}\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
