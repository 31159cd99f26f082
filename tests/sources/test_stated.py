"""What a twin file states of a file is believed, and refused where the file cannot be that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError, UsageError
from evertwin.sources.columns.cells import Cell
from evertwin.sources.recorded import Clock, Recorded
from evertwin.sources.texts.dialect import Stated


def values(path: Path, stated: Stated, column: int = 1, kind: str = "auto") -> list[float]:
    source = Recorded(
        "a", (path,), (Cell("x", column, "m"),), Clock(0, "s"), stated=stated, format=kind
    )
    return [float(x) for chunk in source.read() for x in chunk.v[:, 0]]


@pytest.mark.parametrize(
    ("text", "stated", "expected"),
    [
        ("0;1,5\n1;2,5\n", Stated(decimal=","), [1.5, 2.5]),
        ("0 1.5\n1 2.5\n", Stated(delimiter="blank"), [1.5, 2.5]),
        ("0\t1.5\n1\t2.5\n", Stated(delimiter="tab"), [1.5, 2.5]),
        ("0:1.5\n1:2.5\n", Stated(delimiter=":"), [1.5, 2.5]),
        ("0,1.5\n1,2.5\n", Stated(header=False), [1.5, 2.5]),
        ("0,1\n1,2.5\n2,3.5\n", Stated(header=True), [2.5, 3.5]),
    ],
)
def test_what_is_stated_is_believed(
    tmp_path: Path, text: str, stated: Stated, expected: list[float]
) -> None:
    path = tmp_path / "run.txt"
    path.write_text(text)
    assert values(path, stated) == expected


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, t=np.arange(3.0), x=np.arange(3.0))
    with pytest.raises(DataError, match=r"source 'a' expects csv, this is npz"):
        values(path, Stated(), kind="csv")
    assert values(path, Stated(), kind="numpy") == [0.0, 1.0, 2.0]


def test_a_sign_cannot_mean_two_things() -> None:
    with pytest.raises(UsageError, match="',' cannot both delimit cells and mark decimals"):
        Stated(delimiter=",", decimal=",")
    with pytest.raises(UsageError, match=r"delimiter: expected one sign, .* got 'comma'"):
        Stated(delimiter="comma")
