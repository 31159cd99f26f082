"""What the commands that look ahead do, each in a few lines over `evertwin.Twin`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import typer

from evertwin.app.console import show
from evertwin.app.report_prognosis import write_prognosis
from evertwin.errors import UsageError
from evertwin.fold import plain
from evertwin.prognosis.planning import Plan
from evertwin.settings.quantity import number
from evertwin.twin import Twin
from evertwin.twin.feed import Data
from evertwin.types import Json

__all__ = ["keep_decision", "show_forecast", "show_life", "show_plan", "show_whatif"]

Files: TypeAlias = "Sequence[Path] | None"
Known: TypeAlias = "tuple[Path | None, Files]"
"""History file and recordings."""
VERDICTS = {
    "confirm": "confirmed", "postpone": "postponed", "reject": "declined", "replaced": "replaced",
    "adjusted": "adjusted",
}  # fmt: skip
"""What is said on the command line → what is kept."""


def show_forecast(
    twin: Path, horizon: str, data: Files, told: tuple[Literal["repeat", "hold"], Path | None],
    as_json: bool,
) -> None:  # fmt: skip
    """``evertwin forecast``."""
    with Twin.open(twin) as opened:
        found = opened.forecast(number(horizon, "s", difference=True), _files(data), *told)
        show(found.to_dict(), str(found), as_json)


def show_life(twin: Path, known: Known, report: Path | None, as_json: bool, check: bool) -> None:
    """``evertwin life``."""
    history, data = known
    with Twin.open(twin) as opened:
        found = opened.life(history, _files(data), drawn=report is not None)
        if report is not None:
            write_prognosis(found, None, report)
        show(found.to_dict(), str(found), as_json)
    if check and (found.alarms or found.held):
        raise typer.Exit(1)


def show_whatif(twin: Path, scenario: Path, known: Known, as_json: bool, check: bool) -> None:
    """``evertwin whatif``."""
    history, data = known
    with Twin.open(twin) as opened:
        found = opened.whatif(scenario, _files(data), history)
        show(found.to_dict(), str(found), as_json)
    if check and found.findings:
        raise typer.Exit(1)


def show_plan(
    twin: Path, known: Known, out: Path | None, report: Path | None, as_json: bool
) -> None:
    """``evertwin plan``."""
    history, data = known
    with Twin.open(twin) as opened:
        found = opened.plan(history, _files(data))
        if report is not None:
            lives = opened.life(history, _files(data), drawn=True)
            write_prognosis(lives, found, report)
    if out is not None:
        try:
            out.write_text(found.to_csv(), encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{out}: cannot be written: {error.strerror}") from error
    show(_content(found), _text(found), as_json)


def keep_decision(
    twin: Path, said: tuple[str, str], about: tuple[str, float | None], history: Path | None,
    as_json: bool,
) -> None:  # fmt: skip
    """``evertwin decide``.

    Raises:
        UsageError: another verdict, or a store in memory.
    """
    (component, word), (reason, when) = said, about
    verdict: Any = VERDICTS.get(word)
    if verdict is None:
        raise UsageError(f"decide: expected one of {', '.join(VERDICTS)}, got {word!r}")
    with Twin.open(twin) as opened:
        if opened.spec.store.path is None:
            raise UsageError(f"{twin}: a decision is kept in a store: set [store] path")
        if verdict in ("replaced", "adjusted"):
            event = opened.maintained(component, reason, verdict, when)
        else:
            event = opened.decide(component, verdict, reason, when, history)
    text = f"{component}: {verdict}: {event.reason}"
    show({"schema": "evertwin.event/1", "event": plain(event)}, text, as_json)


def _files(data: Files) -> Data:
    return None if not data else [str(path) for path in data]


def _content(found: Plan) -> dict[str, Json]:
    content: Any = {
        "schema": "evertwin.plan/1", "name": found.name, "unit": found.unit,
        "items": [
            {
                "component": one.component, "after": one.after, "window": one.window,
                "probability_before": one.probability, "cost_rate": one.rate,
                "cost_rate_run_to_failure": one.rate_to_failure, "median_life": one.median,
                "decision": one.decision.verdict, "reason": one.decision.reason,
            }
            for one in found.items
        ],
        "windows": {str(k): names for k, names in found.windows().items()},
        "without_date": found.without,
    }  # fmt: skip
    return content  # type: ignore[no-any-return]


def _text(found: Plan) -> str:
    lines = []
    for one in found.items:
        when = f"after {one.after:.4g} {one.unit}" if one.after < float("inf") else "run to failure"
        window = "" if one.window is None else f" (window {one.window})"
        said = one.decision
        mark = "" if said.verdict == "open" else f"  {said.verdict}: {said.reason}"
        lines.append(
            f"{one.component}: {when}{window}, failure before {one.probability:.3f}, cost "
            f"{one.rate:.4g} a {one.unit} (to failure {one.rate_to_failure:.4g}){mark}"
        )
    lines += [f"{name}: no date: {why}" for name, why in found.without.items()]
    return "\n".join(lines)
