"""Models that come in variants: another law inside, same inputs and outputs.

>>> isinstance(object(), VariantModel)
False
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from evertwin.errors import UsageError
from evertwin.models.contract import Model


@runtime_checkable
class VariantModel(Model, Protocol):
    """A model whose form has named aspects, each with choices.

    >>> hasattr(VariantModel, "with_variant")
    True
    """

    @property
    def variant(self) -> Mapping[str, str]:
        """The choice in force, per aspect."""
        ...

    def with_variant(self, choice: Mapping[str, str]) -> Model:
        """The model with other choices; aspects that are not named stay."""
        ...

    def variants(self) -> Mapping[str, tuple[str, ...]]:
        """All choices per aspect, simplest first."""
        ...


def in_variant(model: Model, choice: Mapping[str, str]) -> Model:
    """The model in a variant.

    Raises:
        UsageError: the model has no variants, or not this one.
    """
    if not isinstance(model, VariantModel):
        raise UsageError(f"expected a model with variants for {dict(choice)}, got {type(model)}")
    known = model.variants()
    for aspect, wanted in choice.items():
        if wanted not in known.get(aspect, ()):
            raise UsageError(f"{aspect}: expected one of {known.get(aspect, ())}, got {wanted!r}")
    return model.with_variant(choice)
