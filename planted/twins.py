"""The twin files of this repository, as they are and with a setting changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from evertwin import Twin, TwinSpec
from evertwin.config import read

TWINS = Path(__file__).parent.parent / "twins"


def shipped(name: str, **sections: Any) -> TwinSpec:
    """A shipped twin file; ``sections`` are keys of a section by its name, or whole values.

    >>> shipped("robot1d", tuning={"window": 60}, beat=10).beat
    10
    """
    spec = read(TWINS / f"{name}.toml")
    changed = {
        section: replace(getattr(spec, section), **keys) if isinstance(keys, dict) else keys
        for section, keys in sections.items()
    }
    return replace(spec, **changed)


def opened(name: str, **sections: Any) -> Twin:
    """The twin of it."""
    return Twin(shipped(name, **sections))
