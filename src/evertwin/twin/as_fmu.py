"""A version of a twin as an FMU for other tools (FMI 2.0 co-simulation, by PythonFMU).

The file holds the model's description, the files it is built from, and a small script. It computes
by evertwin itself: the tool that loads it needs a Python of the same version with evertwin in it.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from evertwin.errors import MissingExtra, UsageError
from evertwin.fold.records import plain
from evertwin.machines.catalog import FILES
from evertwin.models.corrected import build
from evertwin.models.form import Version
from evertwin.twin.twin import Twin

__all__ = ["Written", "write_fmu"]

_SCRIPT = '''"""{name}, version {number}. Needs Python {python} with evertwin installed."""

from pathlib import Path

from evertwin.machines.slave import TwinSlave


class {identifier}(TwinSlave):
    folder = Path(__file__).resolve().parent
'''


class Written(NamedTuple):
    """A file written, and how evertwin reads it back.

    >>> Written(Path("x.fmu"), "3.11", {}).python
    '3.11'
    """

    path: Path
    python: str
    """Version of Python that the loading tool needs, with evertwin installed in it."""
    options: Mapping[str, Any]
    """``[model] kind = "fmu"`` with these options is the same model again."""


def write_fmu(twin: Twin, path: Path, number: int | None = None) -> Written:
    """Writes a version (default: the champion) as an FMU.

    Raises:
        UsageError: the model is an object or an FMU itself, or the name does not end so.
        MissingExtra: PythonFMU is not installed.
    """
    try:
        from pythonfmu.builder import FmuBuilder
    except ModuleNotFoundError as error:
        raise MissingExtra.of("pythonfmu", "fmi") from error
    version = twin.champion if number is None else twin.version(number)
    kind = twin.spec.model.kind
    if path.suffix != ".fmu":
        raise UsageError(f"{path.name}: expected a name that ends with .fmu")
    if kind == "fmu":
        raise UsageError(
            f"{twin.spec.name}: its model is an FMU already: export JSON, which holds the tuned "
            "values and the correction, and set them in the tool"
        )
    if kind == "python" and "file" not in twin.spec.model.options:
        raise UsageError(
            f"{twin.spec.name}: its model was given as an object: put it into a Python file and "
            "name that in a twin file"
        )
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    identifier = "".join(c if c.isalnum() else "_" for c in twin.spec.name.title()) or "Twin"
    identifier = identifier if identifier[0].isalpha() else f"Twin_{identifier}"
    before = list(sys.path)
    with tempfile.TemporaryDirectory(prefix="evertwin-") as name:
        folder = Path(name)
        script = folder / f"evertwin_{identifier.lower()}_{version.hash[:12]}.py"
        script.write_text(
            _SCRIPT.format(name=twin.spec.name, number=version.number, python=python,
                           identifier=identifier),
            encoding="utf-8",
        )  # fmt: skip
        files = _collected(twin, version, folder)
        try:
            FmuBuilder.build_FMU(
                script, dest=path.absolute(), project_files=files,
                canGetAndSetFMUstate=True, canSerializeFMUstate=True,
            )  # fmt: skip
        finally:
            sys.path[:] = before
    return Written(path, python, _options(twin, version, path))


def _collected(twin: Twin, version: Version, folder: Path) -> list[Path]:
    """The description, and a copy of every file that the model is built from."""
    files: list[Path] = []

    def packed(value: Any) -> Any:
        if isinstance(value, str) and value.endswith(FILES):
            source = Path(twin.spec.folder) / value
            target = folder / f"{len(files)}_{source.name}"
            shutil.copyfile(source, target)
            files.append(target)
            return target.name
        if isinstance(value, Mapping):
            return {key: packed(item) for key, item in value.items()}
        return [packed(item) for item in value] if isinstance(value, list | tuple) else value

    content = {
        "name": twin.spec.name, "version": version.number, "hash": version.hash,
        "kind": twin.spec.model.kind, "options": packed(dict(twin.spec.model.options)),
        "form": plain(version.form), "names": version.names, "values": version.values,
    }  # fmt: skip
    description = folder / "model.json"
    description.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return [description, *files]


def _options(twin: Twin, version: Version, path: Path) -> dict[str, Any]:
    model = build(twin.model, version.form)
    states = model.states.names
    found: dict[str, Any] = {"file": path.name}
    if not states:
        return found | {"memory": "none"}
    shown = {name: f"state.{name}" for name in model.outputs.names if name in states}
    return found | {"states": [f"state.{name}" for name in states], "adopts": shown}
