"""A search for parameters: what a terminal shows of it, and ending it early."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from evertwin import Twin
from evertwin.app.console import Search

from .conftest import Command


def test_the_bar_fills_as_the_cost_falls() -> None:
    search = Search()
    lines = []
    for k, cost in enumerate((500.0, 50.0, 80.0, 0.5)):
        assert search(1 + 3 * k, cost)
        lines.append(search.line(1 + 3 * k, cost))
    assert [line.count("#") for line in lines] == [0, 4, 4, 12]
    assert "cost 80, best 50" in lines[2]


def test_a_second_search_begins_anew() -> None:
    search = Search()
    search(1, 9.0)
    search(1, 100.0)
    assert search.best == 100.0


def test_a_terminal_shows_the_cost(call: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda self: True, raising=False)
    done = call("fit", "robot.toml", "--train", "robot.csv")  # type: ignore[operator]
    assert done.code == 0
    assert "evaluations, cost" in done.err
    assert "Ctrl-C keeps it" in done.err
    assert "evaluations, cost" not in done.out


def test_a_second_way_is_shown_beside(call: Command, folder: Path) -> None:
    words = ("fit", "robot.toml", "--train", "robot.csv", "--check", "--beside")
    alike = call(*words, "robot.toml")
    assert "contradict" not in alike.out and "gain" in alike.out.split("\n\n")[-1]
    # 1.2 times the way: so much larger is the gain
    text = (folder / "robot.toml").read_text()
    text = text.replace('unit = "cm" }', 'unit = "cm", scale = 1.2 }').replace("robot.db", "o.db")
    (folder / "other.toml").write_text(text)
    told = call(*words, "other.toml", "--json")
    (gain,) = told.json["beside"]["parameters"]
    assert gain["contradict"] and told.code == 1
    assert gain["there"]["value"] == pytest.approx(1.2 * gain["here"]["value"], rel=0.02)


def test_ctrl_c_ends_a_fit_and_judges_the_best(folder: Path) -> None:
    def watch(evaluations: int, cost: float) -> bool:
        if evaluations > 2:
            signal.raise_signal(signal.SIGINT)
        return True

    with Twin.open(folder / "robot.toml") as twin:
        whole = twin.fit([str(folder / "robot.csv")])
        cut = twin.fit([str(folder / "robot.csv")], watch=watch)
        again = twin.fit([str(folder / "robot.csv")], watch=lambda evaluations, cost: False)
    assert whole.fit.converged
    for stopped in (cut, again):
        assert not stopped.fit.converged
        assert "stopped" in stopped.fit.message
        assert stopped.fit.evaluations < whole.fit.evaluations
        assert stopped.train[0].rms > 0
