"""What the commands that look ahead do, each in a few lines over `evertwin.Twin`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import typer

from evertwin.ahead.planned import Planned
from evertwin.app.console import Progress, show
from evertwin.app.opening import as_kept, recordings, store_path, to_work
from evertwin.app.outlook.plan_text import label_document, label_text, plan_text
from evertwin.errors import UsageError
from evertwin.files import write_whole
from evertwin.fold import plain
from evertwin.prognosis.histories.parameter_history import DONE
from evertwin.prognosis.laws.plans.planning import HEADINGS
from evertwin.prognosis.outlook.upkeep import when_said
from evertwin.settings.quantity import number
from evertwin.twin import Twin

Files: TypeAlias = "Sequence[Path] | None"
Known: TypeAlias = "tuple[Path | None, Files]"
"""History file and recordings."""
VERDICTS = {
    "confirm": "confirmed", "postpone": "postponed", "reject": "declined", "replaced": "replaced",
    "adjusted": "adjusted", "failed": "failed", "withdraw": "withdrawn",
}  # fmt: skip
"""What is said on the command line → what is kept."""
HORIZON = "60 s"
"""Of a forecast, where nothing says how far."""
READ = "history and recordings are read"
OWN = ",".join(HEADINGS[:4])
"""How a plan's file begins."""


def show_forecast(
    twin: Path, horizon: str | None, data: Files,
    told: tuple[Literal["repeat", "hold"] | None, Path | None], as_json: bool,
) -> None:  # fmt: skip
    """``evertwin forecast``.

    Raises:
        UsageError: a horizon that is none, or inputs that are told twice.
    """
    mode, inputs = told
    if inputs is not None and mode is not None:
        raise UsageError("forecast: expected either --inputs or --as: both say the inputs to come")
    try:
        seconds = number(horizon or HORIZON, "s", difference=True)
    except UsageError as error:
        raise UsageError(f"--horizon: {error}; write it as in '30 s' or '2 h'") from error
    planned = None if inputs is None else Planned(inputs, seconds if horizon else math.inf)
    with Twin(as_kept(twin), reading=True) as opened:
        with Progress(READ):
            found = opened.forecast(seconds, recordings(data), mode or "repeat", planned)
        show(found.to_dict(), str(found), as_json)


def show_life(
    twin: Path, known: Known, told: tuple[Path | None, bool], as_json: bool, check: bool
) -> None:
    """``evertwin life``."""
    (history, data), (report, today) = known, told
    with to_work(twin) as opened:
        drawn = report is not None
        with Progress(READ):
            found = opened.life(history, recordings(data), drawn=drawn, from_today=today)
        if report is not None:
            from evertwin.report.prognosis_report import write_prognosis  # pictures take 0.4 s

            write_prognosis(found, None, report)
        show(found.to_dict(), str(found), as_json)
    if check and (found.alarms or found.held):
        raise typer.Exit(1)


def show_whatif(twin: Path, scenario: Path, known: Known, as_json: bool, check: bool) -> None:
    """``evertwin whatif``."""
    history, data = known
    with Twin(as_kept(twin), reading=True) as opened:
        with Progress(READ):
            found = opened.whatif(scenario, recordings(data), history)
        show(found.to_dict(), str(found), as_json)
    if check and found.findings:
        raise typer.Exit(1)


def show_plan(
    twin: Path, known: Known, out: Path | None, report: Path | None, as_json: bool
) -> None:
    """``evertwin plan``.

    Raises:
        UsageError: the file exists and is no plan, or cannot be written.
    """
    history, data = known
    if out is not None:
        _check_plan(out)
    with Twin(as_kept(twin), reading=True) as opened:
        with Progress(READ):
            found = opened.plan(history, recordings(data))
        if report is not None:
            from evertwin.report.prognosis_report import write_prognosis

            lives = opened.life(history, recordings(data), drawn=True)
            write_prognosis(lives, found, report)
    if out is not None:
        write_whole(out, found.to_csv())
    show(found.to_dict(), plan_text(found), as_json)


def _check_plan(file: Path) -> None:
    """A plan is written over an older plan, and over nothing else."""
    if not file.is_file():
        return
    with file.open(encoding="utf-8", errors="replace") as text:
        begin = text.read(len(OWN))
    if begin and begin != OWN:
        raise UsageError(
            f"{file}: exists already and is no plan: choose another name, or delete it"
        )


def show_decisions(twin: Path, as_json: bool) -> None:
    """``evertwin decide TWIN.toml`` alone."""
    with Twin(as_kept(twin), reading=True) as opened:
        found = opened.prospect().history
    items = [label_document(one) for one in found.labels]
    content = {"schema": "evertwin.decisions/1", "clock": found.clock, "decisions": items}
    lines = [label_text(one) for one in found.labels] or ["nothing was said or done yet"]
    show(content, "\n".join(lines), as_json)


def keep_decision(
    twin: Path, said: tuple[str, str], about: tuple[str, str | None], history: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
    """``evertwin decide``.

    Raises:
        UsageError: another verdict, a time that cannot be, or a store in memory.
    """
    (component, word), (reason, at) = said, about
    verdict: Any = VERDICTS.get(word)
    if verdict is None:
        raise UsageError(f"decide: expected one of {', '.join(VERDICTS)}, got {word!r}")
    with to_work(twin, telling=True) as opened:
        store_path(twin, opened.spec)
        when = None
        if at is not None:
            when = when_said(opened.prospect(history), at, itself=verdict in DONE)
        if verdict in DONE:
            event = opened.maintained(component, reason, verdict, when, history)
        else:
            event = opened.decide(component, verdict, reason, when, history)
    text = f"{component}: {verdict}: {event.reason}"
    show({"schema": "evertwin.event/1", "event": plain(event)}, text, as_json)
