"""The names a user may rely on: explicit, sorted, importable, documented."""

from __future__ import annotations

import inspect
import types

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
    assert own <= set(evertwin.__all__)


def test_every_public_name_is_documented() -> None:
    silent = [
        name
        for name in evertwin.__all__
        if callable(value := getattr(evertwin, name)) and not inspect.getdoc(value)
    ]
    assert not silent
