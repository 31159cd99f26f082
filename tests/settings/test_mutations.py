"""Whatever is written into a twin or breakdown file, it is read or refused with a line, at once.

In a process of its own, where no call is checked; more of them by hand, with ``PYTHONPATH=src``:

    python tests/settings/test_mutations.py 60000
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
WORDS = [
    "nan", "inf", "1e999", "9" * 50, "-1", "0", "''", "[]", "{}", "[[]]", "{1..6}", "'{1..3}'",
    "'{a, b}'", "true", "1979-05-27", "'''", '"""', "[", "]", "{", "}", "=", ".", ",", "\n", "\x00",
    "'5 zork'", "'1 m'", "'${X}'", "'${X:-y}'", "0x7fffffffffffffff", "'9^9 m'", "'*'", "'inf s'",
    "[model]", "[[source]]", "5e-324", "like = 'gearbox'", "\ud7ff", "é",
]  # fmt: skip


def mutated(text: str, rng: random.Random) -> str:
    """The text with one mistake."""
    a = rng.randrange(len(text))
    b = a + rng.randrange(1, 30)
    lines = text.splitlines()
    k, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(6):
        case 0:
            return text[:a] + rng.choice(WORDS) + text[a:]
        case 1:
            return text[:a] + text[b:]
        case 2:
            return text[:a] + text[a:b] * rng.choice([2, 3]) + text[b:]
        case 3:
            return text[:a] + chr(rng.randrange(1, 0x300)) + text[a + 1 :]
        case 4:
            lines[k], lines[j] = lines[j], lines[k]
        case _:
            lines[k] = f"{lines[k].split('=')[0]} = {rng.choice(WORDS)}"
    return "\n".join(lines)


def run(count: int) -> None:
    """Raises on the first text that ends in anything but its content or a line."""
    from evertwin.config import reads
    from evertwin.engineering.breakdown import BREAKDOWN
    from evertwin.errors import ConfigError

    rng = random.Random(7)
    files: list[tuple[Callable[[str, str], object], str]] = [
        (read, path.read_text(encoding="utf-8"))
        for folder, read in (("twins", reads), ("twins/breakdowns", BREAKDOWN.parse))
        for path in sorted((ROOT / folder).glob("*.toml"))
    ]
    taken = 0
    for _ in range(count):
        read, text = rng.choice(files)
        for _ in range(rng.randrange(1, 4)):
            text = mutated(text, rng) or "#"
        begin = time.process_time()
        try:
            read(text, "f")
            taken += 1
        except ConfigError as error:
            assert all(line.startswith("f:") for line in str(error).splitlines()), str(error)
        assert time.process_time() - begin < 1.0, text
    sys.stdout.write(f"{count} {taken}\n")


def test_mutations_end_in_their_content_or_a_line() -> None:
    found = subprocess.run(
        [sys.executable, __file__, "600"], capture_output=True, text=True, check=False,
        env={**os.environ, "EVERTWIN_DATA": "data"},
    )  # fmt: skip
    assert found.returncode == 0, found.stderr
    count, taken = map(int, found.stdout.split())
    assert count == 600
    assert 50 < taken < 550


if __name__ == "__main__":
    run(int(sys.argv[1]))
