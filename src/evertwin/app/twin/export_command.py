"""What the commands ``evertwin export`` and ``evertwin model load`` do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evertwin.app.console import show
from evertwin.app.opening import as_kept, recordings, store_path
from evertwin.twin import Twin


def export_twin(
    twin: Path, chosen: tuple[str, Path, int | None], data: Sequence[Path] | None, as_json: bool
) -> None:
    """``evertwin export``: format, file and version are ``chosen``."""
    form, out, version = chosen
    files, made = recordings(data), not out.parent.exists()
    with Twin(as_kept(twin), reading=True) as opened:
        found = opened.export(out, form, version, files)
    content = {
        "schema": "evertwin.export/1", "file": str(found.path), "format": found.format,
        "version": found.version, "parameters": found.parameters, "rows": found.rows,
        "note": found.note,
    }  # fmt: skip
    rows = f", {found.rows} rows" if found.rows else ""
    said = f"{out}: version {found.version}, {found.parameters} parameters{rows}"
    said += f"; {found.note}" if found.note else ""
    said += f"; the folder {out.parent} was made" if made else ""
    show(content, said, as_json)


def load_parameters(twin: Path, file: Path, reason: str, as_json: bool) -> None:
    """``evertwin model load``."""
    with Twin.open(twin) as opened:
        store_path(twin, opened.spec)
        version = opened.load(file, reason)
    content = {
        "schema": "evertwin.load/1", "version": version.number, "hash": version.hash,
        "parent": version.parent, "reason": version.reason,
    }  # fmt: skip
    next_ = f"evertwin model promote {twin} {version.number} makes it live"
    show(content, f"version {version.number}: {version.reason}; {next_}", as_json)
