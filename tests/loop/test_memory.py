"""A long run of a whole twin takes no more memory than a short one."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def peak(hours: int) -> int:
    """Peak resident memory [MB] of a run over ``hours`` files of two minutes each."""
    command = [sys.executable, "-m", "benchmarks.day", "--hours", str(hours), "--rows", "120000"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
    found = re.search(r"peak (\d+) MB", done.stdout)
    assert found, done.stdout
    return int(found[1])


@pytest.mark.long
def test_memory_does_not_grow_with_the_run() -> None:
    short, long = peak(1), peak(6)
    assert long < 500
    assert long - short < 50
