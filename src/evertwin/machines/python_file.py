"""A model that somebody built in a Python file of their own, by the file's and its name.

The file runs with the rights of this process: it is code, not data.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

from evertwin.errors import ConfigError
from evertwin.models import Model

__all__ = ["model_from_file"]


def model_from_file(file: str = "", name: str = "model") -> Model:
    """The Model called ``name`` in a Python file.

    Raises:
        ConfigError: there is no such file, or no such model in it.
    """
    path = Path(file)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ConfigError(f"[model] options: no Python file {path.name!r} beside the twin file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found = getattr(module, name, None)
    if not isinstance(found, Model):
        raise ConfigError(f"{path.name}: expected a model called {name!r}, got {found!r}")
    return found
