"""One mutation from the file to the verdict: what must not happen, by name."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.edge.mutations import mutated
from tests.edge.sandbox import Done, Sandbox
from tests.edge.seeds import SEEDS, Seed

__all__ = ["Verdict", "judged", "planted"]

SECONDS = 1.0
"""Processor time in which a refusal stands."""
MEGABYTES = 512.0
LONGEST = 520
"""Signs of a line of a refusal."""


@dataclass(frozen=True)
class Verdict:
    """What a mutation led to."""

    kind: str
    number: int
    words: tuple[str, ...]
    done: Done
    faults: tuple[str, ...]
    """crash, hang, wrong, slow, large, silent, long: none where all is well."""

    @property
    def refused(self) -> bool:
        """Whether the file was refused."""
        return self.done.code not in (0, 1)


def judged(sandbox: Sandbox, kind: str, number: int) -> Verdict:
    """The verdict on mutation ``number`` of the file of a kind."""
    seed = SEEDS[kind]()
    content = mutated(seed.content, binary=seed.binary, seed=(kind, number))
    words = seed.commands[number % len(seed.commands)]
    return planted(sandbox, kind, number, (seed, content, words))


def planted(
    sandbox: Sandbox, kind: str, number: int, case: tuple[Seed, bytes, tuple[str, ...]]
) -> Verdict:
    """The verdict on a file with this content, given to this command."""
    seed, content, command = case
    words = tuple(word.format(file=seed.file) for word in command)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, beside in seed.beside.items():
            (folder / file).write_bytes(beside)
        (folder / seed.file).write_bytes(content)
        done = sandbox.run(folder, words, seed.reader, seed.file)
    return Verdict(kind, number, words, done, tuple(_faults(done)))


def _faults(done: Done) -> list[str]:
    refused = done.code not in (0, 1)
    lines = done.err.strip().splitlines()
    clean = all(line.startswith("evertwin: ") for line in lines)
    known = {
        "crash": done.code == 101 or (done.code < 0 and not done.hung) or "Traceback" in done.err,
        "hang": done.hung,
        "wrong": bool(done.wrong),
        "slow": refused and not done.hung and done.seconds > SECONDS,
        "large": done.megabytes > MEGABYTES,
        "silent": refused and not done.hung and not (lines and clean),
        "long": refused and any(len(line) > LONGEST for line in lines),
    }
    return [name for name, true in known.items() if true]
