"""A long run of a whole twin takes no more memory than a short one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import day

ROOT = Path(__file__).parents[2]
ROWS, FILES = 60_000, 6


def peak(folder: Path, hours: int) -> int:
    """Peak resident memory [MB] of a run over so many files of a minute each."""
    command = [sys.executable, "-m", "benchmarks.day", "--hours", str(hours), "--fold", str(folder)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
    found = re.search(r"peak (\d+) MB", done.stdout)
    assert found, done.stdout
    return int(found[1])


@pytest.mark.slow
def test_memory_does_not_grow_with_the_run(tmp_path: Path) -> None:
    for hour in range(FILES):
        day.write(tmp_path / f"{hour}.parquet", ROWS, hour)
    short, long = peak(tmp_path, 1), peak(tmp_path, FILES)
    assert long < 500
    assert long - short < 25  # of 300,000 rows
