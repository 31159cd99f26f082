"""A recording with a row a minute, or ten a second: no interval of it is a gap, and an hour is."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin import Twin
from evertwin.app.first.init_command import write_starter
from evertwin.config import read


@pytest.mark.parametrize("step", [0.1, 60.0])
def test_a_gap_is_longer_than_a_few_rows(
    step: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times = [step * (k if k < 200 else k + 60) for k in range(300)]
    rows = [f"{t:g},{k % 7},{20 + k % 5}" for k, t in enumerate(times)]
    (tmp_path / "run.csv").write_text("\n".join(["t,u,y", *rows]) + "\n")
    write_starter([tmp_path / "run.csv"], tmp_path / "new.toml", ("", None), False, False)
    assert read(tmp_path / "new.toml").clock.gap is None  # what is usual tells it
    gaps = Twin.open(tmp_path / "new.toml").run().of_kind("gap")
    assert [event.row for event in gaps] == [200]
