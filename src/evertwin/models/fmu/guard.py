"""Looking at a packed model before anything of it is unpacked.

An FMU is a ZIP archive from somebody else. It is refused whole, before the first byte is written,
when it could fill the disk (a bomb), leave its folder (a path that climbs, is absolute, names a
drive or uses backslashes), hold what is no plain file (links, devices), hide one file behind
another (equal names, a file where a folder has to be), or ask for a password. What the archive
says about its sizes is not believed: unpacking counts what really comes out.

>>> import io, zipfile
>>> file = io.BytesIO()
>>> with zipfile.ZipFile(file, "w") as archive:
...     archive.writestr("../escape.txt", "x")
>>> with zipfile.ZipFile(file) as archive:
...     _ = checked(archive, "pump.fmu", Unpacking())
Traceback (most recent call last):
evertwin.errors.ModelError: pump.fmu: entry '../escape.txt' leaves the folder of the archive: ...
"""

from __future__ import annotations

import re
import stat
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from evertwin.errors import ModelError, UsageError

_REGULAR = (0, stat.S_IFREG, stat.S_IFDIR)
_ARCHIVES = (".7z", ".bz2", ".fmu", ".gz", ".rar", ".tar", ".tgz", ".xz", ".zip", ".zst")
_CHUNK = 1 << 16
_SMALL = 1 << 20
"""Below this size a high ratio harms nobody: a short file of zeros is no bomb [bytes]."""


@dataclass(frozen=True)
class Unpacking:
    """How much an archive may hold.

    >>> Unpacking().files
    10000
    """

    size: int = 256_000_000
    """Unpacked, all files together [bytes]."""
    files: int = 10_000
    ratio: float = 100.0
    """Unpacked over packed size, of one file and of all; files below 1 MB are let through."""

    def __post_init__(self) -> None:
        if self.size < 1 or self.files < 1 or not self.ratio > 0:
            raise UsageError(
                f"unpacking: expected limits above 0, got size {self.size}, files {self.files}, "
                f"ratio {self.ratio}"
            )


@contextmanager
def opened(path: Path, limits: Unpacking) -> Iterator[zipfile.ZipFile]:
    """A checked archive, open for reading.

    Raises:
        ModelError: the file is absent, is no ZIP archive, or `checked` refuses it.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            checked(archive, path.name, limits)
            yield archive
    except FileNotFoundError as error:
        raise ModelError(f"{path.name}: there is no such file: check the path") from error
    except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError, zlib.error) as error:
        raise ModelError(f"{path.name}: expected a ZIP archive, got {error}") from error


def checked(archive: zipfile.ZipFile, where: str, limits: Unpacking) -> list[zipfile.ZipInfo]:
    """The files of an archive, if all of it may be unpacked; ``where`` opens every message.

    Raises:
        ModelError: it may not; says which entry and why.
    """
    entries = archive.infolist()
    if len(entries) > limits.files:
        raise ModelError(
            f"{where}: holds {len(entries)} files, expected at most {limits.files}: raise the "
            "limit `files` if it is yours"
        )
    for entry in entries:
        _check_entry(entry, where)
    _check_names(entries, where)
    _check_sizes(entries, where, limits)
    return [entry for entry in entries if not entry.is_dir()]


def _check_entry(entry: zipfile.ZipInfo, where: str) -> None:
    name = entry.orig_filename
    path = PurePosixPath(name)
    wrong = {
        "has a name with control characters": not name or any(ord(c) < 32 for c in name),
        "has a backslash in its name": "\\" in name,
        "names a drive": re.match(r"^[A-Za-z]:", name) is not None,
        "has an absolute path": path.is_absolute() or name.startswith("/"),
        "leaves the folder of the archive": ".." in path.parts,
        "is a link or a device": stat.S_IFMT(entry.external_attr >> 16) not in _REGULAR,
        "is encrypted": bool(entry.flag_bits & 0x41),
        "is an archive inside the archive": name.lower().endswith(_ARCHIVES),
        "has too long a name": len(name) > 1000 or any(len(part) > 255 for part in path.parts),
    }
    reason = next((said for said, found in wrong.items() if found), "")
    if reason:
        raise ModelError(
            f"{where}: entry {name[:80]!r} {reason}: nothing was unpacked; get the file from its "
            "maker again"
        )


def _check_names(entries: Sequence[zipfile.ZipInfo], where: str) -> None:
    """No two entries on one name, also where case does not count, and no file as a folder."""
    seen: dict[str, str] = {}
    folders: set[str] = set()
    for entry in entries:
        path = PurePosixPath(entry.filename)
        key = str(path).casefold()
        if key in seen and not entry.is_dir():
            raise ModelError(
                f"{where}: entry {entry.filename!r} occurs twice, the other is {seen[key]!r}: "
                "nothing was unpacked"
            )
        seen[key] = entry.filename
        folders.update(str(parent).casefold() for parent in path.parents)
    for entry in entries:
        if not entry.is_dir() and str(PurePosixPath(entry.filename)).casefold() in folders:
            raise ModelError(
                f"{where}: entry {entry.filename!r} is a file and a folder: nothing was unpacked"
            )


def _check_sizes(entries: Sequence[zipfile.ZipInfo], where: str, limits: Unpacking) -> None:
    total = sum(entry.file_size for entry in entries)
    packed = sum(entry.compress_size for entry in entries)
    if total > limits.size:
        raise ModelError(
            f"{where}: would unpack to {total / 1e6:.0f} MB, expected at most "
            f"{limits.size / 1e6:.0f} MB: raise the limit `unpacked` if it is yours"
        )
    parts = [(entry.filename, entry.file_size, entry.compress_size) for entry in entries]
    for name, size, small in [*parts, ("everything", total, packed)]:
        if size > _SMALL and size > limits.ratio * small:
            raise ModelError(
                f"{where}: {name!r} unpacks to {size / max(small, 1):.0f} times its size, expected "
                f"at most {limits.ratio:g}: a bomb; raise the limit `ratio` if it is yours"
            )


def unpack(
    archive: zipfile.ZipFile, folder: Path, where: str, limits: Unpacking, prefixes: Sequence[str]
) -> int:
    """Writes the entries below one of ``prefixes`` into ``folder``: bytes written.

    Raises:
        ModelError: an entry holds more than it said, or is damaged.
    """
    written = 0
    for entry in checked(archive, where, limits):
        if not any(entry.filename.startswith(prefix) for prefix in prefixes):
            continue
        target = folder.joinpath(*PurePosixPath(entry.filename).parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        written += _copy(archive, entry, target, where)
        if written > limits.size:
            raise ModelError(
                f"{where}: unpacked more than {limits.size / 1e6:.0f} MB, more than it said: a bomb"
            )
    return written


def _copy(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path, where: str) -> int:
    written = 0
    with archive.open(entry) as source, target.open("xb") as sink:
        while chunk := source.read(_CHUNK):
            written += len(chunk)
            if written > entry.file_size:
                raise ModelError(
                    f"{where}: entry {entry.filename!r} holds more than the {entry.file_size} "
                    "bytes it says: a bomb"
                )
            sink.write(chunk)
    return written
