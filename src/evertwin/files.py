"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from evertwin.errors import UsageError


def write_whole(path: Path, content: bytes | str) -> None:
    """Writes a file whole or not at all; its folder is made where it lacks, text is UTF-8.

    Raises:
        UsageError: it cannot be written.
    """
    raw = content if isinstance(content, bytes) else content.encode("utf-8")
    # a device or a pipe is written to, never replaced
    part = path if path.exists() and not path.is_file() else path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(raw)
        if part != path:
            part.replace(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        if part != path and part.parent.is_dir():
            part.unlink(missing_ok=True)


def make_whole(path: Path, make: Callable[[Path], None]) -> None:
    """A file that ``make`` makes, on the disk whole or not at all, in place of one before."""
    part = path.with_name(path.name + ".part")
    part.unlink(missing_ok=True)
    make(part)
    with part.open("rb") as written:
        os.fsync(written.fileno())
    part.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
