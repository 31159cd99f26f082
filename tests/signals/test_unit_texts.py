"""A text that is no unit is a mistake of the user's, whatever pint stumbles over."""

from __future__ import annotations

import pytest

from evertwin.errors import UsageError
from evertwin.signals import si_unit


@pytest.mark.parametrize("text", ["Ns/mm/", "m/(s", "m**", "*m", "m)", "1/", "m**s", "'", "#", "€"])
def test_no_unit_is_refused_by_name(text: str) -> None:
    with pytest.raises(UsageError, match="is not known"):
        si_unit(text)
