"""What a file is, told from its first bytes, never from its name alone.

A pickle is recognised to be refused. So are the files that people hand over by mistake: a web page
saved instead of the recording, a Git LFS pointer, a spreadsheet, an archive.

>>> kind_of(b"PAR1....", "run.csv")
'parquet'
>>> kind_of(b"t,x\\n0,1\\n", "run.csv")
'text'
"""

from __future__ import annotations

import gzip
import io
import re
import zlib
from pathlib import Path

from evertwin.errors import DataError, naming

_MAGIC = {
    b"\x89MCAP0\r\n": "mcap",
    b"#ROSBAG V2.0": "ros1",
    b"SQLite format 3\0": "db3",
    b"PAR1": "parquet",
    b"\x93NUMPY": "npy",
    b"PK\x03\x04": "npz",
    b"MATLAB 5.0": "mat",
    b"MATLAB 7.3": "mat73",
    b"\x1f\x8b": "gzip",
}
_REFUSED = {
    b"\x89HDF\r\n\x1a\n": "an HDF5 file: save the columns as Parquet or CSV, or as MAT with -v7",
    b"ARROW1": "a Feather or Arrow file: save it as Parquet",
    b"PARE": "an encrypted Parquet file: decrypt it first",
    b"#ROSBAG V1": "a ROS bag of version 1: convert it with `rosbag fix` to version 2",
    b"BZh": "a bzip2 archive: unpack it first",
    b"\xfd7zXZ": "an xz archive: unpack it first",
    b"\x28\xb5\x2f\xfd": "a zstd archive: unpack it first",
    b"7z\xbc\xaf": "a 7-Zip archive: unpack it first",
    b"\xff\xfe": "UTF-16 text: save it as UTF-8",
    b"\xfe\xff": "UTF-16 text: save it as UTF-8",
    b"version https://git-lfs": "a Git LFS pointer, not the recording: run `git lfs pull`",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook: save the sheet as CSV",
    b"%PDF": "a PDF document",
}
_PICKLES = tuple(b"\x80" + bytes([protocol]) for protocol in range(1, 6))
_PICKLE_NAMES = (".pkl", ".pickle", ".joblib", ".pt", ".pth")
_CARMEN = re.compile(
    rb"(?:#[^\n]*\n|\s)*"
    rb"(?:(?:PARAM|SYNC|ODOM|FLASER|RLASER|TRUEPOS|(?:ROBOT|RAW)LASER\d|VERTEX2|EDGE2|NEFF) )"
)
_JSON = re.compile(rb"\s*(?:\{\s*[\"}]|\[\s*[\[{\"])")
HEAD = 4096


def sniff(path: Path) -> str:
    """The kind of ``path``: text, carmen, mat, mat73, parquet, npy, npz, mcap, ros1, db3, …

    Raises:
        DataError: no such file, an empty one, or one that is never read (the reason is given).
    """
    try:
        if path.is_dir():
            return "directory"
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise DataError(f"{path}: {error.strerror or error}: check the path") from None
    with naming(path.name, DataError, DataError):
        kind = kind_of(head, path.name)
        if kind == "gzip":
            kind = _inside_gzip(path)
    return kind


def opened(path: Path) -> io.BufferedIOBase:
    """A text on disk, unpacked where it is packed."""
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
    return gzip.open(path, "rb") if packed else path.open("rb")


def kind_of(head: bytes, name: str) -> str:
    """The kind of a file that begins with ``head`` and is called ``name``.

    Raises:
        DataError: a file that is never read.
    """
    if not head:
        raise DataError("the file is empty: record again, or check the copy")
    if head.startswith(_PICKLES) or name.lower().endswith(_PICKLE_NAMES):
        raise DataError(
            "a pickle runs code when it is read and is never loaded: save as npz or CSV"
        )
    if name.lower().endswith(".toml"):
        raise DataError("expected a recording, got a TOML file: give the recordings themselves")
    for magic, reason in _REFUSED.items():
        if head.startswith(magic):
            raise DataError(f"expected a recording, got {reason}")
    if head.startswith(b"PK\x03\x04"):
        _check_zip(head)
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    if head.lstrip()[:9].lower().startswith((b"<!doctype", b"<html", b"<?xml")):
        raise DataError("expected a recording, got a web page or XML: the download went wrong")
    if _JSON.match(head):
        raise DataError("expected a recording, got JSON: save the columns as CSV, npz or Parquet")
    if b"\0" in head:
        raise DataError(
            "unknown binary file; known are CSV and other text, MAT 5 and 7.3, Parquet, npy, npz, "
            "MCAP, ROS 1 and ROS 2 bags"
        )
    return "carmen" if _CARMEN.match(head) else "text"


def _check_zip(head: bytes) -> None:
    """Arrays of NumPy are the only archive that is read; its first entry's name says what it is.

    Raises:
        DataError: another one.
    """
    first = head[30 : 30 + int.from_bytes(head[26:28], "little")]
    if first.startswith((b"[Content_Types]", b"_rels/", b"docProps/", b"xl/")):
        raise DataError("expected a recording, got an Excel workbook: save the sheet as CSV")
    if first == b"mimetype":
        raise DataError("expected a recording, got an OpenDocument file: save the sheet as CSV")
    if not first.endswith(b".npy"):
        raise DataError("expected a recording, got a zip archive: unpack it first")


def _inside_gzip(path: Path) -> str:
    try:
        with gzip.open(path, "rb") as file:
            head = file.read(HEAD)
    except (OSError, EOFError, zlib.error) as error:
        raise DataError(f"damaged gzip ({error}): copy the file again") from None
    kind = kind_of(head, path.name.removesuffix(".gz"))
    if kind not in ("text", "carmen") or head[257:262] == b"ustar":
        raise DataError(f"gzip is read for text only, inside is {kind}: unpack it first")
    return kind
