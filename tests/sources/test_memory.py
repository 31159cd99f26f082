"""Reading a long recording takes no more memory than reading a short one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).parents[2] / "benchmarks" / "stream.py"


def peak(hours: float, kind: str) -> dict[str, float]:
    command = [sys.executable, str(BENCH), "--hours", str(hours), "--format", kind]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    content: dict[str, float] = json.loads(done.stdout)
    return content


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "short", "long"), [("parquet", 0.05, 0.2), ("csv", 0.004, 0.016)])
def test_memory_does_not_grow_with_the_file(kind: str, short: float, long: float) -> None:
    few, many = peak(short, kind), peak(long, kind)
    assert many["rows"] == pytest.approx(long * 3.6e6, abs=2)
    assert many["peak_mb"] < 500
    assert many["peak_mb"] - few["peak_mb"] < 60
