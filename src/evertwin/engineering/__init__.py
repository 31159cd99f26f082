"""From a list of components to a model, the parameters to tune, and how often: with every reason.

The method of Aivaliotis, Arkouli, Georgoulias, Makris, "Methodology for enabling dynamic digital
twins ..." (2023): break the machine down into components, rank them, choose how deeply each is
modelled, map signals to parameters, choose the parameters to tune and how often.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.engineering.validation import Validation as Validation, validated as validated

__getattr__ = surface(__name__)
