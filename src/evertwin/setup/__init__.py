"""A twin put together from its file: model, detectors, scores, the state that is folded, and what
versions are off by."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.setup.configured_model import (
        model_of as model_of,
        with_units as with_units,
    )
    from evertwin.setup.setup import Setup as Setup

__getattr__ = surface(__name__)
