"""``evertwin info``: what a recording or a twin file holds."""

from __future__ import annotations

import math
from pathlib import Path

import typer

from evertwin.app.console import show
from evertwin.app.first.doctor_site import is_site
from evertwin.config import TwinSpec, read
from evertwin.errors import DataError, UsageError
from evertwin.fold import plain
from evertwin.signals.units import conversion_of
from evertwin.sources.info import inspect
from evertwin.sources.info_text import render
from evertwin.sources.recording import open_recording
from evertwin.sources.robot_logs.bag_scans import scans_of
from evertwin.sources.spec import SourceSpec


def show_info(file: Path, as_json: bool, check: bool, picture: Path | None = None) -> None:
    """``evertwin info``; ``picture``: a file for some of its images; where it has none, its scans.

    Raises:
        DataError: no such file, or neither image nor scan for the picture.
    """
    if not file.exists():
        raise DataError(f"{file}: no such file")
    if file.suffix.lower() == ".toml":
        return _show_twin(file, as_json)
    sheet = None
    if picture is not None:
        from evertwin.report.image_picture import Sheet  # loads matplotlib

        sheet = Sheet()
    found = inspect(file, None if sheet is None else sheet.add)
    if picture is not None and sheet is not None:
        if sheet.kept:
            sheet.save(picture)
        else:
            _draw_scans(file, picture)
    show(found.to_dict(), render(found), as_json)
    if check and found.findings:
        raise typer.Exit(1)


def _draw_scans(file: Path, picture: Path) -> None:
    from evertwin.report.scan_picture import draw_scans  # loads matplotlib

    scans = [one for one in scans_of(open_recording(file)) if len(one.t)]
    if not scans:
        raise DataError(
            f"{file}: no image and no scan that can be read: --picture has nothing to show"
        )
    draw_scans(scans).savefig(picture, dpi=110)


def _show_twin(file: Path, as_json: bool) -> None:
    """What a twin file says; no model is built, no recording read.

    Raises:
        UsageError: it is a site file.
    """
    if is_site(file):
        raise UsageError(f"{file}: a site file: evertwin doctor {file} tells what its machines say")
    twin = read(file)
    kept = "on a server" if twin.store.server else twin.store.path or "nothing"
    tuned = ", ".join(twin.tuning.editable or ()) or "what the model proposes"
    lines = [
        f"{file}: twin {twin.name}, model {twin.model.kind}{_options(twin)}",
        *map(_source, twin.source),
        f"  watched: {', '.join(twin.anomaly.outputs) or 'all outputs'}, requirement "
        f"{_requirement(twin)}, predictions of {twin.prediction.horizon:g} s",
        f"  tuned: {tuned}; corrected: {', '.join(twin.correction.channels) or 'nothing'}; kept: "
        f"{kept}",
        f"next: evertwin doctor {file}",
    ]
    content = {
        "schema": "evertwin.twin/1", "name": twin.name, "model": twin.model.kind,
        "options": twin.model.options, "sources": {one.name: one.channels for one in twin.source},
        "files": {one.name: one.files for one in twin.source}, "anomaly": twin.anomaly,
        "horizon": twin.prediction.horizon, "editable": twin.tuning.editable,
        "corrected": twin.correction.channels, "store": twin.store.path,
    }  # fmt: skip
    show({key: plain(value) for key, value in content.items()}, "\n".join(lines), as_json)


def _options(twin: TwinSpec) -> str:
    return "".join(f", {key} {value}" for key, value in twin.model.options.items())


def _source(source: SourceSpec) -> str:
    time = source.time
    clock = f"{time.rate:g} Hz" if time.rate else f"time {time.column} [{time.unit}]"
    channels = (f"{name} = {one.column} [{one.unit}]" for name, one in source.channels.items())
    files = ", ".join(source.files) or "files by --data"
    return f"  source {source.name}: {files}; {clock}; {', '.join(channels)}"


def _requirement(twin: TwinSpec) -> str:
    asked = twin.anomaly
    if math.isinf(asked.requirement):
        return "none (nothing is tuned or corrected)"
    if asked.relative:
        return f"{100 * asked.requirement:g} % of the rms"
    return f"{asked.requirement / conversion_of(asked.unit)[0]:g} {asked.unit or '(SI)'}"
