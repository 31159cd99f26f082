"""A version as an FMU for other tools (FMI 2.0 co-simulation, by PythonFMU).

The file holds the model's description, the files it is built from, and a small script. It computes
by evertwin itself: the tool that loads it needs a Python of the same version with evertwin in it
(`need_of`). `reading_options` says how evertwin reads it back.

Its states start where the recordings end, so that a tool that sets nothing begins at the machine as
it was last seen; without recordings where the model itself starts, which is then said.

>>> need_of().startswith("needs Python 3.")
True
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from importlib import import_module
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import DataError, ModelError, UsageError, needs
from evertwin.export.content import Exported
from evertwin.files import write_whole
from evertwin.fold.records import plain
from evertwin.machines.catalog import FILES, with_files
from evertwin.settings.writing import inline
from evertwin.setup.newest import state_after
from evertwin.types import StateVector, Vector

_SCRIPT = '''"""{identifier}, version {number}: {need}."""

from {module} import {base}


class {identifier}({base}):
    description = {said!r}
'''


def need_of() -> str:
    """What a tool needs to load such an FMU."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return f"needs Python {python} with evertwin {version_of('evertwin')} installed"


def write_fmu(out: Exported, path: Path) -> str:
    """Writes the version as an FMU, whole or not at all; what a tool needs to load it.

    Raises:
        UsageError: the model is an object or an FMU itself, or the name does not end with .fmu.
        MissingExtra: PythonFMU is not installed.
        ModelError: the model cannot be built from what the twin file says.
    """
    with needs("fmi", "pythonfmu"):
        builder = import_module("pythonfmu.builder").FmuBuilder
        slave = import_module("evertwin.machines.slave")
    _check(out, path)
    begun = _begun(out)
    before = list(sys.path)
    with tempfile.TemporaryDirectory(prefix="evertwin-") as name:
        folder = Path(name)
        identifier = _identifier(out.name)
        script = folder / f"evertwin_{identifier.lower()}_{out.version.hash[:12]}.py"
        text = _SCRIPT.format(
            identifier=identifier, number=out.version.number, need=need_of(),
            said=f"{need_of()}; {begun.said}",
            module=slave.__name__, base=slave.TwinSlave.__name__,
        )  # fmt: skip
        script.write_text(text, encoding="utf-8")
        files, made = _collected(out, begun, folder), folder / "made" / path.name
        try:
            builder.build_FMU(
                script, dest=made, project_files=files, canGetAndSetFMUstate=True,
                canSerializeFMUstate=True,
            )  # fmt: skip
            write_whole(path, made.read_bytes())
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
        finally:
            sys.path[:] = before
    options = ", ".join(f"{k} = {inline(v)}" for k, v in reading_options(out, path).items())
    read = f'a twin file reads it by kind = "fmu", options = {{ {options} }}'
    return f"{need_of()}; {begun.said}; {read}"


class _Begun(NamedTuple):
    """Where an FMU starts."""

    said: str
    inputs: Vector
    state: StateVector | None = None
    """None: where the model does."""
    step: float | None = None
    """Of the recorded rows, as a rule [s]."""


def _begun(out: Exported) -> _Begun:
    """The newest recorded inputs, and the state after them."""
    model, p = out.model, out.version.p
    inputs = np.zeros(len(model.inputs))
    try:
        rows, why = out.recorded(), "no recordings say where it starts"
    except DataError as error:
        rows, why = (), f"where it starts is not known ({error})"
    if not rows:
        own = zip(model.states.names, model.initial(p), strict=True)
        said = ", ".join([*(f"state.{name} ({value:.6g})" for name, value in own),
                          *(f"{name} (0)" for name in model.inputs.names)])  # fmt: skip
        return _Begun(f"{why}: set {said}", inputs)
    last = rows[-1]
    for k, column in enumerate(last.u.T):
        known = column[np.isfinite(column)]
        inputs[k] = known[-1] if len(known) else 0.0
    step = float(f"{np.median(last.dt[1:]):.6g}") if len(last.t) > 1 else None
    state = state_after(model, p, last) if len(model.states) else None
    return _Begun("starts where the recordings end", inputs, state, step)


def _check(out: Exported, path: Path) -> None:
    if path.suffix != ".fmu":
        raise UsageError(f"{path.name}: expected a name that ends with .fmu")
    if out.kind == "fmu":
        raise UsageError(
            f"{out.name}: its model is an FMU already: export JSON, which holds the tuned values "
            "and the correction, and set them in the tool"
        )
    if out.kind == "python" and "file" not in out.options:
        raise UsageError(
            f"{out.name}: its model was given as an object: put it into a Python file and name "
            "that in a twin file"
        )


def _identifier(name: str) -> str:
    """A name that C and Python take."""
    text = "".join(c if c.isascii() and c.isalnum() else "_" for c in name.title())
    return text if text[:1].isalpha() else f"Twin_{text}"


def _collected(out: Exported, begun: _Begun, folder: Path) -> list[Path]:
    """The description, and a copy of every file that the model is built from."""
    files: list[Path] = []

    def packed(name: str) -> str:
        if not name.endswith(FILES):
            return name  # a folder of libraries stays where it is
        source = Path(out.folder) / name
        target = folder / f"{len(files)}_{source.name}"
        try:
            shutil.copyfile(source, target)
        except OSError as error:
            raise ModelError(f"{source}: cannot be read: {error.strerror}") from error
        files.append(target)
        return target.name

    version = out.version
    content = {
        "name": out.name, "version": version.number, "hash": version.hash, "kind": out.kind,
        "options": with_files(out.options, packed), "form": version.form,
        "names": version.names, "values": version.values, "start": begun.state,
        "inputs": begun.inputs, "step": begun.step,
        "low": [item.low for item in out.model.parameters],
        "high": [item.high for item in out.model.parameters],
        "editable": [item.editable for item in out.model.parameters],
    }  # fmt: skip
    description = folder / "model.json"
    description.write_text(json.dumps(plain(content), indent=1), encoding="utf-8")
    return [description, *files]


def reading_options(out: Exported, path: Path) -> dict[str, Any]:
    """``[model] kind = "fmu"`` with these options is the same model again."""
    states = out.model.states.names
    found: dict[str, Any] = {"file": path.name}
    if not states:
        return found | {"memory": "none"}
    shown = {name: f"state.{name}" for name in out.model.outputs.names if name in states}
    return found | {"states": [f"state.{name}" for name in states], "adopts": shown}
