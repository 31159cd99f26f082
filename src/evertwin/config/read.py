"""Reading a twin file.

>>> twin = reads('schema = 1\\nname = "axis"\\n[model]\\nkind = "drive"\\n[clock]\\nrate = "1 kHz"')
>>> twin.name, twin.clock.rate, twin.clock.gap
('axis', 1000.0, None)
>>> reads('schema = 1\\nname = "axis"\\n[model]\\nkind = "drive"\\n[clock]\\nrat = 5', "axis.toml")
Traceback (most recent call last):
evertwin.errors.ConfigError: axis.toml:6: [clock] unknown key 'rat', did you mean 'rate'?
"""

from __future__ import annotations

import dataclasses
import fnmatch
import glob
from collections.abc import Sequence
from pathlib import Path

from evertwin.config.spec import SCHEMA, TwinSpec
from evertwin.errors import ConfigError, DataError, UsageError, naming
from evertwin.settings.form import Form
from evertwin.settings.notes import Path as Place
from evertwin.settings.notes import dotted, expand
from evertwin.sources.spec import ArraySpec, SourceSpec

_ABOUT = """# The twin file

A twin file is TOML: one section a concept, one key a setting. A quantity is a number in SI, or text
with its unit (`"2 cm"`). `${NAME}` and `${NAME:-default}` are replaced from the environment;
`"q{1..6}"` stands for six entries ([patterns](../how-to/twin-files.md)). An unknown key is an error
that names the nearest one and its line; numbers outside their range are refused.

The JSON schema for editors comes from `evertwin schema`.
"""

TWIN = Form(TwinSpec, SCHEMA, "twin file", _ABOUT)
"""How twin files are read."""


def read(path: str | Path) -> TwinSpec:
    """The twin file at ``path``.

    Raises:
        ConfigError: the file cannot be read, or does not say what it must; the message has one line
            for each problem, ``file:line: what was expected, what came``.
    """
    twin = TWIN.parse(TWIN.load(path), str(path))
    return dataclasses.replace(twin, folder=str(Path(path).resolve().parent), file=str(path))


def place(twin: TwinSpec, path: Place) -> str:
    """``file:line: key``, of a setting that only a model can judge; a twin without a file: the key.

    >>> place(reads('schema = 1\\nname = "axis"\\nmodel = { kind = "drive" }'), ("clock", "rate"))
    'clock.rate'
    """
    key = dotted(path)
    if not twin.file:
        return key
    try:
        return f"{twin.file}:{TWIN.document(TWIN.load(twin.file), twin.file).line(path)}: {key}"
    except ConfigError:  # changed or gone since it was read
        return f"{twin.file}: {key}"


def reads(text: str, name: str = "") -> TwinSpec:
    """The twin file written in ``text``; ``name`` stands in messages.

    Raises:
        ConfigError: as `read`.
    """
    return TWIN.parse(text, name)


def recorded(twin: TwinSpec) -> tuple[SourceSpec | ArraySpec, ...]:
    """What is read from recordings: the sources, the scans that poses are made of, labels."""
    taken = [] if twin.perception is None else [twin.perception.scan]
    taken += [] if twin.labels is None else [twin.labels.source]
    return (*twin.source, *(one for one in twin.array if one.name in taken))


def files_of(twin: TwinSpec, given: Sequence[str | Path] = ()) -> dict[int, tuple[Path, ...]]:
    """The files of each of what is `recorded`: those ``given``, sorted by ``match``, else those in
    the twin file. A bag belongs to all sources of its topics, another file to the first source that
    it fits; to scans belongs each file that fits them.

    Raises:
        ConfigError: an environment variable in a path is not set.
        DataError: a file or pattern matches nothing, or a given file belongs to no source.
    """
    every, arrays = recorded(twin), range(len(twin.source), len(recorded(twin)))
    if not given:
        return {i: _written(twin, i) for i in range(len(every))}
    found: dict[int, list[Path]] = {i: [] for i in range(len(every))}
    for item in given:
        path = Path(item)
        matches = [i for i, s in enumerate(twin.source) if fnmatch.fnmatch(path.name, s.match)]
        if not path.exists():
            raise DataError(f"{path}: no such file")
        scans = [i for i in arrays if fnmatch.fnmatch(path.name, every[i].match)]
        if not matches and not scans:
            raise DataError(f"{path}: belongs to no source of the twin: {_sources(twin)}")
        topics = [i for i in matches if _of_topic(twin.source[i])]
        for i in (*(topics if set(matches[:1]) <= {*topics} else matches[:1]), *scans):
            found[i].append(path)
    return {i: tuple(paths) for i, paths in found.items()}


def _sources(twin: TwinSpec) -> str:
    if not twin.source:
        return (
            "it has none, so no file says which column is which channel: write [[source]] (source "
            "= (SourceSpec(…),) of a TwinSpec), or give the columns by name: a DataFrame, a dict"
        )
    return f"they match {', '.join(repr(source.match) for source in recorded(twin))}"


def _of_topic(source: SourceSpec) -> bool:
    """Are its columns those of a bag?"""
    return any(str(one.column).startswith("/") for one in source.channels.values())


def _written(twin: TwinSpec, index: int) -> tuple[Path, ...]:
    paths: list[Path] = []
    one = recorded(twin)[index]
    array = isinstance(one, ArraySpec)
    key = ("array", twin.array.index(one)) if array else ("source", index)
    for text in one.files:
        with naming(f"{twin.name}: {dotted((*key, 'files'))}", UsageError, ConfigError):
            pattern = str(Path(twin.folder) / expand(text))
        found = sorted(glob.glob(pattern)) if glob.has_magic(pattern) else [pattern]
        if not found or not Path(found[0]).exists():
            where = place(twin, (*key, "files"))
            raise DataError(f"{pattern}: no such file: correct {where}, or give --data FILE")
        paths += [Path(item) for item in found]
    return tuple(paths)
