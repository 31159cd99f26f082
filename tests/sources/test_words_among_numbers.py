"""A word among numbers is no value; what may be a number written otherwise is asked back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.sources.texts.text import TextTable


def table(folder: Path, words: dict[int, str], rows: int = 400) -> TextTable:
    """Lines ``0.05,0.125``; a word in the place of some values."""
    lines = [f"{0.05 * k:.2f},{words.get(k, f'{0.001 * k:.3f}')}" for k in range(rows)]
    file = folder / "run.csv"
    file.write_text("\n".join(["t,v", *lines, ""]))
    return TextTable(file)


@pytest.mark.parametrize(
    "word", ["Bad", "I/O Timeout", "---", "-1.#IND", "1.#QNAN0", "##", "#DIV/0!", "E104"]
)
def test_a_word_is_no_value(tmp_path: Path, word: str) -> None:
    (rows,) = table(tmp_path, {200: word}).rows(["v"], "t")
    v = rows.values[:, 0]
    assert np.flatnonzero(np.isnan(v)).tolist() == [200]
    assert v[201] == 0.201
    (told,) = rows.problems
    assert (told.kind, told.line, told.detail) == ("text", 202, f"v: {word!r}")


@pytest.mark.parametrize("word", ["12 mm", "<0.5", "1'049", "0x1F", "1.2.3", "$5", "-5V"])
def test_what_may_be_a_number_is_asked_back(tmp_path: Path, word: str) -> None:
    with pytest.raises(DataError, match=r"run.csv:202: column 'v': expected a number"):
        list(table(tmp_path, {200: word}).rows(["v"], "t"))


@pytest.mark.parametrize("some", [slice(None), slice(0, 210)])
def test_a_column_of_words_is_refused(tmp_path: Path, some: slice) -> None:
    words = dict.fromkeys(range(400)[some], "Bad")
    with pytest.raises(DataError, match=r"run.csv:2: column 'v': expected a number, got 'Bad'"):
        list(table(tmp_path, words).rows(["v"], "t"))


def test_words_first_do_not_make_it_a_column_of_words(tmp_path: Path) -> None:
    (rows,) = table(tmp_path, dict.fromkeys(range(80), "---")).rows(["v"], "t")
    assert np.isnan(rows.values[:80, 0]).all()
    assert np.isfinite(rows.values[80:, 0]).all()
    assert len(rows.problems) == 80
