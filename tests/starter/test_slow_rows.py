"""A recording with a row a minute: no interval of it is a gap."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.app.starting import write_starter
from evertwin.config import read


@pytest.mark.parametrize(("step", "gap"), [(0.1, 10.0), (60.0, 600.0)])
def test_a_gap_is_longer_than_a_few_rows(
    step: float, gap: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{step * k:g},{k % 7},{20 + k % 5}" for k in range(300)]
    (tmp_path / "run.csv").write_text("\n".join(["t,u,y", *rows]) + "\n")
    write_starter([tmp_path / "run.csv"], tmp_path / "new.toml", ("", None), False, False)
    assert read(tmp_path / "new.toml").clock.gap == gap
