"""The machines by the names that a twin file uses, and those that other packages add.

Another package registers a factory under the entry point group ``evertwin.models``; it is called
with the options of the twin file and gives a Model.

>>> machine("robot1d", {}).inputs.names
('v',)
>>> machine("robot", {})
Traceback (most recent call last):
evertwin.errors.UsageError: no model 'robot', did you mean 'robot1d'?
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from evertwin.errors import EvertwinError, ModelError, UsageError, nearest, needs
from evertwin.models import FunctionModel, Model
from evertwin.models.functions.translated import translated

MACHINES: Mapping[str, tuple[str, str]] = {
    "arm": ("evertwin.machines.arm:Arm.of", "arm"),
    "assembly": ("evertwin.machines.assembly:assembly", ""),
    "bicycle": ("evertwin.machines.mobile:Bicycle", ""),
    "differential": ("evertwin.machines.mobile:Differential", ""),
    "drive": ("evertwin.machines.drive:Drive", ""),
    "drive_force": ("evertwin.machines.drive:DriveForce", ""),
    "modelica": ("evertwin.models.modelica.openmodelica:modelica", "modelica"),
    "mujoco": ("evertwin.models.mujoco:model_of_file", "mujoco"),
    "fmu": ("evertwin.models.fmu:fmu", "fmi"),
    "odometer": ("evertwin.machines.mobile:Odometer", ""),
    "omni": ("evertwin.machines.mobile:Omni", ""),
    "python": ("evertwin.machines.python_file:model_from_file", ""),
    "robot1d": ("evertwin.machines.mobile:Robot1D", ""),
    "table": ("evertwin.machines.measured:measured_table", ""),
    "thermal": ("evertwin.machines.thermal:ThermalBox", ""),
}
"""Name → module and factory, and the extra that it needs."""

FILES = (".urdf", ".py", ".xml", ".mo", ".fmu", ".csv", ".mat", ".npz", ".parquet")
"""Endings of files that models are read from."""
FOLDERS = ("libraries",)
"""Options whose entries may be folders."""


def machine(kind: str, options: Mapping[str, Any], *, compiled: bool = True) -> Model:
    """The model called ``kind``, built with ``options``; a plain step as machine code if it can,
    unless it need not be ``compiled``, as where nothing is simulated.

    Raises:
        UsageError: there is no such model, or it does not take these options.
        ModelError: the factory of another package raised something.
        MissingExtra: a package that it needs is not installed.
    """
    factory = _factory(kind)
    try:
        made = factory(**options)
    except TypeError as error:
        known = _options(factory)
        for key in options:
            if known and key not in known:
                hint = nearest(key, known)
                raise UsageError(f"[model] kind = {kind!r}: no option {key!r}, {hint}") from error
        raise UsageError(f"[model] kind = {kind!r}: {error}: check the options") from error
    except Exception as error:
        if kind in MACHINES or isinstance(error, EvertwinError):
            raise
        raise ModelError(f"[model] kind = {kind!r}: {type(error).__name__}: {error}") from error
    return translated(made) if compiled and type(made) is FunctionModel else made


def _options(factory: Callable[..., Model]) -> tuple[str, ...]:
    """The options that a factory names; none where it takes any."""
    there = inspect.signature(factory).parameters.values()
    if any(item.kind is item.VAR_KEYWORD for item in there):
        return ()
    return tuple(item.name for item in there)


def with_files(value: Any, change: Callable[[str], str], key: str = "") -> Any:
    """Options with every name of a file or folder in them changed.

    >>> with_files({"file": "a.mo", "libraries": ["more"], "model": "A"}, str.upper)
    {'file': 'A.MO', 'libraries': ['MORE'], 'model': 'A'}
    """
    if isinstance(value, str):
        return change(value) if value.endswith(FILES) or key in FOLDERS else value
    if isinstance(value, list | tuple):
        return type(value)(with_files(item, change, key) for item in value)
    if isinstance(value, Mapping):
        return {name: with_files(item, change, name) for name, item in value.items()}
    return value


def located(folder: str | Path, value: Any) -> Any:
    """Options with the files that they name, found beside the twin file.

    >>> located("/machines", {"urdf": "arm.urdf", "law": "sign"})
    {'urdf': '/machines/arm.urdf', 'law': 'sign'}
    """
    return with_files(value, lambda name: str(Path(folder) / name))


def contents(folder: str | Path, options: Mapping[str, Any]) -> str:
    """A hash of what the files hold that options name; of one that is not there, of its name.

    >>> contents("/machines", {"law": "sign"}) == contents("/robots", {})
    True
    """
    found = hashlib.sha256()

    def add(name: str) -> str:
        path = Path(folder) / name
        found.update(f"{name}\n".encode())
        if path.is_file():
            found.update(path.read_bytes())
        return name

    with_files(options, add)
    return found.hexdigest()


def _factory(kind: str) -> Callable[..., Model]:
    if kind in MACHINES:
        place, extra = MACHINES[kind]
        with needs(extra or "all"):
            return resolve_name(place)  # type: ignore[no-any-return]
    plugins = entry_points(group="evertwin.models")
    if kind in plugins.names:
        return plugins[kind].load()  # type: ignore[no-any-return]
    raise UsageError(f"no model {kind!r}, {nearest(kind, sorted([*MACHINES, *plugins.names]))}")
