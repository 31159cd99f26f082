"""From the command to the first result: `python -m benchmarks.start [--demo]`.

Processor time of whole processes, start of the interpreter included: the least of five, after one
that fills the caches. `fit` learns six friction parameters from 690 rows of a 6-axis arm, `doctor`
looks at 145 such recordings. With
``--demo`` the demonstration runs as well, with an empty and with a full cache of machine code:
wall-clock until each machine's result is on the screen, and the longest silence on both streams.
Those hold on an idle machine alone. Needs MuJoCo.
"""

from __future__ import annotations

import argparse
import itertools
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from planted.worlds import record_arm, record_robot

ROOT = Path(__file__).parent.parent
EVERTWIN = [sys.executable, "-m", "evertwin"]
REPEATS = 5


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def spent(command: list[str], environment: dict[str, str]) -> float:
    """Processor seconds of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, env=environment, capture_output=True, check=True, cwd=ROOT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def processor(folder: Path, environment: dict[str, str]) -> bool:
    """Prints what commands cost; True where nothing takes longer than asked."""
    record_robot(folder / "robot.csv")
    record_arm(folder / "arm", "--cycles", "145")
    cycles = sorted(map(str, folder.glob("arm/*.csv")))
    arm = cycles[0]
    commands = {
        "python -c 'from evertwin import Twin'": (
            [sys.executable, "-c", "from evertwin import Twin"], 0.0,
        ),
        "evertwin --help": ([*EVERTWIN, "--help"], 0.0),
        "evertwin info, 504 rows": ([*EVERTWIN, "info", str(folder / "robot.csv")], 1.0),
        "evertwin fit, 690 rows": ([*EVERTWIN, "fit", "twins/arm.toml", "--train", arm], 1.5),
        "evertwin doctor, 100,050 rows": (
            [*EVERTWIN, "doctor", "twins/arm.toml", "--data", *cycles], 10.0,
        ),
    }  # fmt: skip
    held = True
    for name, (command, asked) in commands.items():
        spent(command, environment)
        least = min(spent(command, environment) for _ in range(REPEATS))
        limit = f"   asked {asked:.1f} s" if asked else ""
        held &= not asked or least <= asked
        say(f"{name:40} {least:6.2f} s{limit}")
    return held


def watched(out: Path, environment: dict[str, str]) -> tuple[dict[str, float], float, float]:
    """Seconds until each machine's result, until the end, and the longest silence."""
    began = time.monotonic()
    heard, found = [began], {}

    def listen(stream: object) -> None:
        for line in stream:  # type: ignore[attr-defined]
            heard.append(time.monotonic())
            for name in ("robot", "arm"):
                if line.startswith(f"{name}: ") and " rows in " in line:
                    found[name] = heard[-1] - began

    with subprocess.Popen(
        [*EVERTWIN, "demo", "--out", str(out)], env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        threads = [
            threading.Thread(target=listen, args=(s,)) for s in (process.stdout, process.stderr)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    heard.append(time.monotonic())
    times = sorted(heard)
    return found, times[-1] - began, max(b - a for a, b in itertools.pairwise(times))


def main() -> int:
    """Exit code 0 if nothing takes longer than asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--demo", action="store_true", help="on an idle machine")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # As installed: Python's own byte code is kept.
        environment = os.environ | {
            "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "",
        }  # fmt: skip
        held = processor(folder, environment)
        for cache, asked in (("empty", 30.0), ("full", 8.0)) if chosen.demo else ():
            kept = environment | {"NUMBA_CACHE_DIR": str(folder / "demo")}
            found, whole, silence = watched(folder / cache, kept)
            told = ", ".join(f"{name} {at:.1f} s" for name, at in found.items())
            say(f"evertwin demo, {cache} cache: {told}, all {whole:.1f} s, asked {asked:.0f} s "
                f"for the first; longest silence {silence:.1f} s, asked 3 s")  # fmt: skip
            held &= min(found.values()) <= asked and silence <= 3.0
    say(f"start: {'held' if held else 'missed'}")
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
