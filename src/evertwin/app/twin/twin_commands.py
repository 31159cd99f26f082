"""What the commands do, each in a few lines over `evertwin.Twin`."""

from __future__ import annotations

import getpass
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from evertwin.app.console import Progress, Search, show
from evertwin.app.opening import as_kept, recordings, store_path, to_work
from evertwin.doctor.finding import SHOWN
from evertwin.fold import plain
from evertwin.models.form import Version
from evertwin.outcome.result import RunResult
from evertwin.store import SqliteStore
from evertwin.twin import Twin
from evertwin.types import Json

Files = Sequence[Path] | None
FINDINGS = (
    "measurement_error", "abnormal", "drift", "rolled_back", "not_identifiable", "external",
    "not_judged",
)  # fmt: skip


def run_twin(
    twin: Path, data: Files, report: Path | None, shown: tuple[bool, bool, bool],
    again: bool, workers: int | None,
) -> None:  # fmt: skip
    """``evertwin run``; ``shown`` as JSON, with every event, with an exit code for findings."""
    as_json, every, check = shown
    with Twin.open(twin) as opened:
        result = _run(opened, data, again=again, workers=workers)
        if report is not None:
            from evertwin.report.run_report import write_report  # draws with Matplotlib

            write_report(result, opened.setup, report)
        show(result.to_dict(), result.text(every=every), as_json)
        if not opened.setup.decides:
            unit = next(iter(opened.setup.model.outputs)).unit
            typer.echo(
                f"evertwin: {twin}: nothing is tuned or corrected without a requirement: set "
                f"[anomaly] requirement, such as '1 {unit}' or 0.05 of the rms",
                err=True,
            )
    odd = result.of_kind(*FINDINGS) or result.faults or result.missed or not result.judged
    if check and (odd or any(one.finding for one in result.left_out)):
        raise typer.Exit(1)


def show_kpi(twin: Path, data: Files, changed: float | None, as_json: bool) -> None:
    """``evertwin kpi``."""
    with Twin.open(twin) as opened:
        found = opened.kpi(_run(opened, data), changed)
        show(found.to_dict(), str(found), as_json)


def _run(
    opened: Twin, data: Files, *, again: bool = False, workers: int | None = None
) -> RunResult:
    """Runs it; what goes on, and which rows were not run now, goes to stderr."""
    progress, store = Progress(), opened.store
    if isinstance(store, SqliteStore) and store.recovered is not None:
        typer.echo(f"evertwin: {store.path}: {store.recovered.reason}", err=True)
    result = opened.run(recordings(data), progress, again=again, workers=workers)
    progress.close()
    for line in _went_on(result):
        typer.echo(f"evertwin: {line}", err=True)
    return result


def _went_on(result: RunResult) -> Iterator[str]:
    """Which rows were not run now, because they had been run before."""
    if result.passed:
        yield f"{result.passed} rows were passed over: runs before had them"
    if result.began == result.samples:
        yield "no row is new: what was found then is shown; evertwin run --again runs all rows anew"
    elif result.began:
        yield f"the run was cut off and went on from row {result.began}"


def fit_twin(
    twin: Path, data: tuple[Sequence[Path], Sequence[Path]], flags: tuple[bool, bool, bool],
    workers: int | None, other: Path | None = None,
) -> None:  # fmt: skip
    """``evertwin fit``; ``data``: to learn from, to be judged on; ``flags``: JSON, check, keep;
    ``other``: a twin file whose fit to the same recordings is shown beside."""
    from evertwin.tuning import Route, beside, shown

    search, (train, test), (as_json, check, keep) = Search(), data, flags
    with Twin.open(twin) if keep else Twin(as_kept(twin), reading=True) as opened:
        if keep:
            store_path(twin, opened.spec)
        files = recordings(test) or []
        # of several sources, one recording alone lacks what the others record
        tests = [files] if files and len(opened.spec.source) > 1 else files
        result = opened.fit(recordings(train), tests, search, workers)
        search.close()
        told, text, routes = dict[str, Json](), str(result), tuple[Route, ...]()
        if other is not None:  # before anything is kept: its file may be wrong
            with Twin.open(other, reading=True) as second:
                there = second.fit(recordings(train), (), search, workers)
            search.close()
            routes = beside(result.fit, there.fit)
            told["beside"] = {"name": there.name, "parameters": [one.to_dict() for one in routes]}
            text += "\n\n" + shown(routes, (result.name, there.name))
        version = opened.keep(result) if keep else None
        told |= {} if version is None else {"version": version.number}
        show(result.to_dict() | told, text, as_json)
    if version is not None:
        said = f"kept as version {version.number}: evertwin model promote {twin} {version.number}"
        typer.echo(f"{said} makes it live", err=True)
    unsure = not result.fit.converged or "not" in result.fit.verdict
    unsure = unsure or any(one.contradict for one in routes)
    if check and (unsure or any(one.finding for one in result.left_out)):
        raise typer.Exit(1)


def examine(twin: Path, data: Files, every: bool, as_json: bool) -> None:
    """``evertwin doctor``: of a twin file; of a site file what its machines say."""
    from evertwin.app.first.doctor_site import is_site, look_at

    if is_site(twin):
        return look_at(twin, as_json)
    progress = Progress("the rows are read")
    with Twin(as_kept(twin), reading=True) as opened:
        try:
            found = opened.doctor(recordings(data))
        finally:
            progress.close()
        most = len(found.findings) if every else SHOWN
        show(found.to_dict(), found.text(most), as_json)
    if found.findings:
        raise typer.Exit(1)


def compare_versions(twin: Path, pair: tuple[int, int], data: Files, as_json: bool) -> None:
    """``evertwin compare``."""
    with Twin(as_kept(twin), reading=True) as opened:
        found = opened.compare(*pair, recordings(data))
        show(found.to_dict(), str(found), as_json)


def list_versions(twin: Path, as_json: bool) -> None:
    """``evertwin model list``."""
    with Twin(as_kept(twin), reading=True) as opened:
        live = opened.champion.number
        versions = opened.versions
        content = {
            "schema": "evertwin.versions/1",
            "champion": live,
            "pinned": opened.pinned,
            "head": opened.store.head.printed(),
            "versions": [_brief(v) for v in versions],
        }
        lines = [
            f"{'*' if v.number == live else ' '} {v.number:>3}  {v.hash[:12]}  {v.reason}"
            for v in versions
        ]
        show(content, "\n".join(lines), as_json)


def show_version(twin: Path, number: int, as_json: bool) -> None:
    """``evertwin model show``."""
    with Twin(as_kept(twin), reading=True) as opened:
        version = opened.version(number)
        known = opened.known_of(number)
        about = [e for e in opened.events if e.evidence.get("version") == number]
        content = _brief(version) | {
            "schema": "evertwin.version/1",
            "form": version.form,
            "parameters": {
                name: {key: one[key] for key in ("value", "unit", "interval95", "verdict")}
                for name, one in known.items()
            },
            "events": about,
        }
        lines = [f"version {number}  {version.hash}"]
        lines += [f"made from {version.parent}: {version.reason}"]
        lines += [f"  {term.kind} on {term.channel} {term.variant}" for term in version.form.terms]
        lines += [f"  {name:<16} {_told(one)}" for name, one in known.items()]
        lines += [f"  row {e.row}: {e.kind}: {e.reason}" for e in about]
        show(content, "\n".join(lines), as_json)


def _told(known: Mapping[str, Any]) -> str:
    """A value with its interval and verdict, where a fit has told them."""
    said = f"{known['value']:.6g} {known['unit']}"
    if known["interval95"] is None:
        return said
    low, high = known["interval95"]
    return f"{said}  ({low:.4g} … {high:.4g}, 95 %; {known['verdict']})"


def by_hand(twin: Path, verb: str, number: int | None, reason: str, as_json: bool) -> None:
    """``evertwin model promote | rollback | pin``."""
    person = getpass.getuser()
    with to_work(twin, telling=True) as opened:
        store_path(twin, opened.spec)
        if verb == "pin":
            event = opened.pin(number, reason, person)
        elif verb == "rollback":
            event = opened.rollback(reason, person)
        else:
            event = opened.promote(-1 if number is None else number, reason, person)
        show({"schema": "evertwin.event/1", "event": plain(event)}, event.reason, as_json)


def _brief(version: Version) -> dict[str, object]:
    return {
        "version": version.number,
        "hash": version.hash,
        "parent": version.parent,
        "reason": version.reason,
        "row": version.row,
        "terms": len(version.form.terms),
    }
