"""The names a user may rely on: explicit, sorted, importable, documented."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import subprocess
import sys
import types

import pytest

import evertwin


def test_the_surface_is_sorted_and_without_repeats() -> None:
    names = list(evertwin.__all__)
    assert names == sorted(set(names))


def test_every_public_name_can_be_imported() -> None:
    missing = [name for name in evertwin.__all__ if not hasattr(evertwin, name)]
    assert not missing


def test_no_name_is_public_by_accident() -> None:
    own = {
        name
        for name, value in vars(evertwin).items()
        if not name.startswith("_")
        and not isinstance(value, types.ModuleType)
        and getattr(value, "__module__", "").startswith("evertwin")
    }
    assert own - {"surface"} <= set(evertwin.__all__)


def test_every_public_name_is_documented() -> None:
    silent = [
        name
        for name in evertwin.__all__
        if callable(value := getattr(evertwin, name)) and not inspect.getdoc(value)
    ]
    assert not silent


def packages() -> list[types.ModuleType]:
    """evertwin and every room or part of a room that lists public names."""
    found = pkgutil.walk_packages(evertwin.__path__, "evertwin.")
    rooms = [importlib.import_module(m.name) for m in found if m.ispkg]
    return [evertwin, *(room for room in rooms if hasattr(room, "__all__"))]


@pytest.mark.parametrize("package", packages(), ids=lambda p: p.__name__)
def test_every_room_gives_what_it_lists(package: types.ModuleType) -> None:
    files = {m.name for m in pkgutil.iter_modules(package.__path__)}
    lazy = "__getattr__" in vars(package)
    assert len(package.__all__) == len(set(package.__all__))
    assert not (lazy and files & set(package.__all__)), "importing the file would hide the name"
    for name in package.__all__:
        assert not isinstance(getattr(package, name), types.ModuleType)
    with pytest.raises(AttributeError, match="has no attribute 'absent'"):
        package.absent  # noqa: B018


HEAVY = ("jaxtyping", "matplotlib", "numba", "numpy", "pandas", "pint", "pinocchio", "scipy")


def loaded(code: str) -> set[str]:
    """Which heavy packages a fresh process has loaded after ``code``."""
    ask = f"import sys\n{code}\nprint(*[m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("module", ["evertwin", "evertwin.app.cli", "evertwin.tuning"])
def test_a_package_loads_nothing_heavy(module: str) -> None:
    assert not loaded(f"import {module}")
