"""Pictures of reports: vectors, with the values behind them, and nobody's markup."""

from __future__ import annotations

import html
import json
import re

import numpy as np
from matplotlib.figure import Figure

from evertwin.report.charts import MARKS, inline

HOSTILE = '"><script>window.hit=1</script>'


def values(text: str) -> list:  # type: ignore[type-arg]
    """What the script of the page tells."""
    found = re.search(r'data-values="([^"]*)"', text)
    assert found is not None
    return list(json.loads(html.unescape(found.group(1))))


def test_a_picture_tells_the_values_that_it_draws() -> None:
    figure = Figure(figsize=(6, 3), layout="constrained")
    axes = figure.subplots()
    y = np.array([1.0, np.nan, 3.0, 4.0])
    axes.plot([3.0, 2.0, 1.0, 0.0], y, "k", label="measured")
    axes.axhline(0.0)
    axes.set(xlabel="time [s]", ylabel="x [mm]")
    (told,) = values(inline(figure, "x"))
    assert told["unit"] == "mm" and told["along"] == "time [s]"
    assert told["lines"] == [{"name": "measured", "x": [0.0, 1.0, 3.0], "y": [4.0, 3.0, 1.0]}]
    left, top, right, bottom = told["box"]
    assert 0 < left < right <= 6 * 72 and 0 <= top < bottom < 3 * 72
    x0, x1 = told["x"]
    assert x0 < 0.0 < 3.0 < x1


def test_names_stay_text_and_black_follows_the_page() -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0, 1, 2], [0, 1, 2], color="#000000", label=HOSTILE)
    axes.set_ylabel(f"{HOSTILE} [m]")
    axes.legend()
    text = str(inline(figure, HOSTILE))
    assert "<script" not in text and "&lt;script&gt;" in text
    assert "#000000" not in text and "currentColor" in text
    assert "http" not in text and not re.findall(r' id="(?!p|m|h)', text)


def test_many_marks_are_one_picture_so_that_the_report_stays_small() -> None:
    def size(count: int) -> int:
        figure = Figure()
        axes = figure.subplots()
        axes.plot(np.arange(count), np.sin(np.arange(count)), ".", label="measured")
        return len(inline(figure, "many"))

    assert size(MARKS + 1) < size(MARKS) and size(40 * MARKS) < 1_000_000
