"""What was decided, as it is stored: versions, events, labels, and the log of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.ledger.label import Label as Label
    from evertwin.ledger.ledger import Ledger as Ledger
    from evertwin.ledger.versions import Versions as Versions

__getattr__ = surface(__name__)
