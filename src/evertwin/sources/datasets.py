"""Public data sets: what they are, whose they are, and the hash of every file.

The recordings themselves are not part of evertwin: their licences differ, or are not declared.
`verify` compares a local folder with the registry, so that a figure can be traced to exact bytes.

>>> [name for name in registry() if name == "emps"]
['emps']
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from evertwin.errors import UsageError
from evertwin.sources.names import closest

__all__ = ["DataSet", "FileState", "registry", "verify"]


@dataclass(frozen=True)
class DataSet:
    """One public data set.

    >>> registry()["emps"].licence != ""
    True
    """

    name: str
    machine: str
    """The machine and what was recorded."""
    origin: str
    """Where to get it."""
    licence: str
    """Licence, or that none is declared."""
    citation: str
    sha256: Mapping[str, str]
    """File, relative to the set's folder → SHA-256."""


@dataclass(frozen=True)
class FileState:
    """One file of a set in a local folder.

    >>> FileState("emps", "DATA_EMPS.mat", "ok").state
    'ok'
    """

    data_set: str
    file: str
    state: str
    """ok, absent or changed."""


@cache
def registry() -> Mapping[str, DataSet]:
    """All data sets by name."""
    text = files("evertwin.sources").joinpath("datasets.toml").read_text(encoding="utf-8")
    return {
        name: DataSet(
            name, entry["machine"], entry["origin"], entry["licence"], entry["citation"],
            dict(entry["sha256"]),
        )
        for name, entry in tomllib.loads(text).items()
    }  # fmt: skip


def verify(folder: Path, names: tuple[str, ...] = ()) -> tuple[FileState, ...]:
    """The state of every registered file below ``folder``.

    Args:
        folder: holds one folder per set, called like the set.
        names: sets to look at; all by default.

    Raises:
        UsageError: a set that is not registered.
    """
    known = registry()
    for name in names:
        if name not in known:
            raise UsageError(f"no data set {name!r}; {closest(name, list(known))}")
    return tuple(
        FileState(name, file, _state(folder / name / file, digest))
        for name in names or tuple(known)
        for file, digest in known[name].sha256.items()
    )


def _state(path: Path, digest: str) -> str:
    if not path.is_file():
        return "absent"
    with path.open("rb") as file:
        return "ok" if hashlib.file_digest(file, "sha256").hexdigest() == digest else "changed"
