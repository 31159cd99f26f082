"""Whatever a stranger hands over: `python -m proofs.edge [MUTATIONS] [WORKERS] [KIND ...]`.

Files of 29 kinds, each with one or two things wrong, go through the command line's own entry, every
call in a process of its own with a limit of time and memory. Counted are exit codes 101, hangs,
values that another reader reads otherwise, refusals that take more than a second or 512 MB, and
refusals that are not one clear line each.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain

from tests.edge.judge import Verdict, judged
from tests.edge.sandbox import Sandbox
from tests.edge.seeds import SEEDS

WORST = ("crash", "hang", "wrong")


def verdicts(kinds: Sequence[str], numbers: Sequence[int]) -> list[Verdict]:
    """Mutations ``numbers`` of every kind, one after another in one sandbox."""
    done = []
    with Sandbox(seconds=20.0) as sandbox:
        for number in numbers:
            for kind in kinds:
                done.append(judged(sandbox, kind, number))
                if done[-1].faults:
                    print(shown(done[-1]), flush=True)
    return done


def split(count: int, kinds: Sequence[str], workers: int) -> Iterator[list[int]]:
    """The mutations of each worker."""
    each = -(-count // len(kinds))
    for worker in range(workers):
        yield list(range(worker, each, workers))


def shown(found: Verdict) -> str:
    """A fault, so that it can be looked for."""
    said = (found.done.wrong or found.done.err.strip().splitlines() or ["nothing said"])[-1]
    return (
        f"    {found.kind} {found.number} ({' '.join(found.words)}): {', '.join(found.faults)}, "
        f"exit {found.done.code}, {found.done.seconds:.1f} s, {found.done.megabytes:.0f} MB: "
        f"{said[:160]}"
    )


def main(arguments: list[str]) -> int:
    """Exit code 0 if nothing crashed, hung or came out wrong."""
    count, workers = (*map(int, arguments[:2]), *(10_000, 2)[len(arguments[:2]) :])
    kinds = arguments[2:] or list(SEEDS)
    began = time.perf_counter()
    with ThreadPoolExecutor(workers) as pool:
        parts = pool.map(lambda n: verdicts(kinds, n), split(count, kinds, workers))
        every = list(chain.from_iterable(parts))
    faults = Counter(fault for found in every for fault in found.faults)
    for kind in kinds:
        mine = [found for found in every if found.kind == kind]
        refused = sum(found.refused for found in mine)
        slowest = max(found.done.seconds for found in mine if found.refused or found is mine[0])
        print(f"    {kind}: {len(mine)} files, {refused} refused, slowest refusal {slowest:.2f} s")
    said = ", ".join(f"{name} {faults[name]}" for name in
                     (*WORST, "slow", "large", "silent", "long"))  # fmt: skip
    print(
        f"edge: {len(every)} mutations of {len(kinds)} kinds of file, refused "
        f"{sum(found.refused for found in every)}: {said}; {time.perf_counter() - began:.0f} s"
    )
    return 1 if any(faults[name] for name in WORST) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
