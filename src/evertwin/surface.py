"""The public names of a package, each loaded when it is first used (PEP 562).

A package lists its names once, as ``import Name as Name`` under ``if TYPE_CHECKING:``, where type
checkers, editors and the ladder of imports read them. ``__getattr__ = surface(__name__)`` reads the
same list and gives it as ``__all__``; importing one file of a room does not load the others:

>>> import evertwin.signals
>>> evertwin.signals.Layout.__module__
'evertwin.signals.channels'
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
import sys
from collections.abc import Callable
from functools import cache
from typing import Any


def surface(package: str) -> Callable[[str], Any]:
    """The ``__getattr__`` of ``package``.

    A name must differ from every file of the package: importing the file would hide it.
    """

    def load(name: str) -> Any:
        if name == "__all__":
            return sorted(_listed(package))
        home = None if name.startswith("__") else _listed(package).get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(home), name)
        setattr(sys.modules[package], name, value)
        return value

    return load


@cache
def _listed(package: str) -> dict[str, str]:
    """Name → module of every import that stands under ``if TYPE_CHECKING:``."""
    source = pkgutil.get_data(package, "__init__.py") or b""
    guarded = [n for n in ast.parse(source).body if isinstance(n, ast.If) and _says(n.test)]
    found = [n for block in guarded for n in block.body if isinstance(n, ast.ImportFrom)]
    return {a.asname or a.name: str(n.module) for n in found for a in n.names}


def _says(test: ast.expr) -> bool:
    return isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"
