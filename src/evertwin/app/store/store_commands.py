"""What the commands ``evertwin store …`` and ``evertwin events`` do. No model is built."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import typer

from evertwin.app.console import show
from evertwin.app.opening import as_kept, store_path
from evertwin.config import read
from evertwin.errors import StoreDamaged, StoreError, UsageError
from evertwin.fold import Chunk, Event
from evertwin.ledger.owner import check_owner
from evertwin.signals import Channel, Layout
from evertwin.signals.series import Series
from evertwin.signals.units import si_unit
from evertwin.sources import Lists, write
from evertwin.sources.spec import ArraySpec, SourceSpec
from evertwin.sources.writers import WRITERS
from evertwin.store import Head, SqliteStore, SqlStore, looked_at, restore

TASK = "task"
"""Column of an export with the number of each sample's task."""


def show_events(twin: Path, kind: str | None, as_json: bool) -> None:
    """``evertwin events``."""
    with _store(twin) as store:
        logged = [(entry.number, store.record(entry)) for entry in store.entries(kinds=("event",))]
    events = [(n, e) for n, e in logged if isinstance(e, Event)]
    found = [(n, e) for n, e in events if kind in (None, e.kind)]
    if kind is not None and not found:
        kinds = ", ".join(sorted({e.kind for _, e in events}))
        typer.echo(f"evertwin: no event is {kind!r}; the log has {kinds or 'none'}", err=True)
    lines = [f"{n:>6}  row {e.row:>8}  {e.kind:<18} {e.signal:<8} {e.reason}" for n, e in found]
    told = [{"number": n, **dataclasses.asdict(e)} for n, e in found]
    show({"schema": "evertwin.events/1", "events": told}, "\n".join(lines), as_json)


def show_head(twin: Path, key: Path | None, as_json: bool) -> None:
    """``evertwin store head``."""
    with _store(twin) as store:
        head = store.head
    printed = head.printed(_secret(key))
    content = {"schema": "evertwin.head/1", "length": head.length, "hash": head.hash}
    show(content | {"printed": printed}, printed, as_json)


def verify_store(twin: Path, text: str | None, key: Path | None, as_json: bool) -> None:
    """``evertwin store verify``.

    Raises:
        StoreDamaged: names the first entry that does not match, and what to do.
    """
    head = None if text is None else Head.parse(text, _secret(key))
    with _store(twin) as store:
        try:
            count = store.verify(head)
        except StoreDamaged as error:
            raise StoreDamaged(
                f"{error}\nevertwin store recover {twin} starts from what is sound"
            ) from error
    against = "" if head is None else f", entry {head.length} as it was printed"
    content = {"schema": "evertwin.verify/1", "entries": count}
    show(content, f"{count} entries, all of them sound{against}", as_json)


def recover_store(twin: Path, as_json: bool) -> None:
    """``evertwin store recover``.

    Raises:
        UsageError: there is no store.
    """
    path = _path(twin)
    if not path.is_file():
        raise UsageError(f"{path}: no such store: nothing to recover")
    with closing(SqliteStore(path)) as store:
        event = store.recovered
        if event is None:
            try:
                count = store.verify(None)
            except StoreDamaged:
                event = store.recover()
    if event is None:
        content = {"schema": "evertwin.verify/1", "entries": count}
        return show(content, f"{count} entries, all of them sound: nothing to recover", as_json)
    show({"schema": "evertwin.event/1", "event": event}, event.reason, as_json)


def back_up(twin: Path, file: Path, as_json: bool) -> None:
    """``evertwin store backup``.

    Raises:
        UsageError: the file exists, or cannot be written.
    """
    if file.exists() or not file.parent.is_dir():
        why = "exists already" if file.exists() else "its folder is missing"
        raise UsageError(f"{file}: {why}: choose another name")
    with _store(twin) as store:
        try:
            store.backup(file)
        except OSError as error:
            raise UsageError(f"{file}: cannot be written: {error.strerror}") from error
        length = store.head.length
    content = {"schema": "evertwin.backup/1", "file": str(file), "entries": length}
    show(content, f"{file}: {length} entries", as_json)


def put_back(twin: Path, file: Path, as_json: bool) -> None:
    """``evertwin store restore``.

    Raises:
        UsageError: there is no such file.
        StoreError: it is the store of another twin.
    """
    if not file.is_file():
        raise UsageError(f"{file}: no such file")
    path = _path(twin)
    if twin.suffix != ".db":
        with closing(looked_at(file, "")) as store:
            _check_owner(store, read(twin).name)
    entries = restore(path, file)
    content = {"schema": "evertwin.backup/1", "file": str(path), "entries": entries}
    show(content, f"{path}: {entries} entries, as {file} has them", as_json)


def export_samples(
    twin: Path,
    file: Path,
    chosen: tuple[str, Path | None],
    span: tuple[float, float],
    as_json: bool,
) -> None:
    """``evertwin store export``.

    Raises:
        UsageError: no such source, no samples of it, or several for a file that holds one.
    """
    source, store_file = chosen
    spec = read(twin) if store_file is not None else as_kept(twin)
    low, high = (int(1e9 * min(max(edge, -4e9), 4e9)) for edge in span)
    path = store_path(twin, spec) if store_file is None else store_file
    every: dict[str, SourceSpec | ArraySpec] = {one.name: one for one in spec.source}
    every |= {one.name: one for one in spec.array}
    wanted = [name for name in every if source in ("", name)]
    if not wanted:
        raise UsageError(f"{path}: no source is {source!r}, there are {', '.join(every)}")
    with closing(SqliteStore(path, read_only=True)) as store:
        if store_file is None:
            _check_owner(store, spec.name)
        chunks = {name: list(store.samples(name, low, high)) for name in wanted}
    found = {name: _series(every[name], kept) for name, kept in chunks.items() if kept}
    if not found:
        raise UsageError(
            f"{path}: no samples of {', '.join(wanted)} in that time: kept is what was pushed to a "
            "running twin; recordings stay in their files"
        )
    lists = {name: one for name, one in found.items() if isinstance(one, Lists)}
    rows = {name: one for name, one in found.items() if isinstance(one, Series)}
    if file.suffix.lower() in WRITERS and file.suffix.lower() != ".mcap":
        if len(rows) > 1 or not rows:
            one = f"name one of them (--source {next(iter(rows))})" if rows else "they are arrays"
            raise UsageError(f"{file.name}: cannot hold {', '.join(found)}: {one}, or write .mcap")
        lists = {}
    write(file, rows, lists)
    counts = {name: len(one.t) for name, one in found.items() if name in {**rows, **lists}}
    content = {"schema": "evertwin.samples/1", "file": str(file), "samples": counts}
    said = ", ".join(f"{count} of {name}" for name, count in counts.items())
    show(content, f"{file}: samples: {said}", as_json)
    for name in wanted:
        if name not in counts:
            why = "arrays go into .mcap only" if chunks[name] else "no samples in that time"
            typer.echo(f"evertwin: {name} is left out: {why}", err=True)


def _series(source: SourceSpec | ArraySpec, chunks: Sequence[Chunk]) -> Series | Lists:
    """Samples of a source in SI, by stamp; the number of their task beside them."""
    t, v = np.concatenate([c.t for c in chunks]), np.concatenate([c.v for c in chunks])
    task = np.concatenate([np.full(len(c.t), float(c.task)) for c in chunks])
    order = np.argsort(t, kind="stable")
    if isinstance(source, ArraySpec):
        return Lists(source.column, t[order], v[order], task[order])
    channels = [Channel(name, si_unit(one.unit)) for name, one in source.channels.items()]
    layout = Layout((*channels, Channel(TASK, "1")))  # so that it can be run as it was lived
    return Series(layout, t[order], np.column_stack([v, task])[order])


def _path(twin: Path) -> Path:
    """The store of a twin file; of the service, the store file itself."""
    return twin if twin.suffix == ".db" else store_path(twin, read(twin))


def _store(twin: Path) -> closing[SqlStore]:
    """The store of a twin file, or a store file itself.

    Raises:
        StoreError: the store that the twin file names is another twin's.
    """
    if twin.suffix == ".db":
        return closing(looked_at(twin, ""))
    spec = as_kept(twin)
    if spec.store.server is not None:
        return closing(looked_at(spec.store.server, spec.name))
    store = looked_at(store_path(twin, spec), "")
    try:
        _check_owner(store, spec.name)
    except StoreError:
        store.close()
        raise
    return closing(store)


def _check_owner(store: SqlStore, name: str) -> None:
    """Is the log this twin's? A damaged one is told where it is read."""
    with suppress(StoreDamaged):
        for entry in store.entries(kinds=("event",)):
            event = store.record(entry)
            if isinstance(event, Event) and event.kind == "configured":
                return check_owner(event, name)


def _secret(key: Path | None) -> bytes:
    """The secret in a file.

    Raises:
        UsageError: it cannot be read, or is empty.
    """
    if key is None:
        return b""
    try:
        secret = key.read_bytes().strip()
    except OSError as error:
        raise UsageError(f"{key}: cannot be read: {error.strerror}") from error
    if not secret:
        raise UsageError(f"{key}: expected a secret, the file is empty")
    return secret
