"""Looking ahead: what the machine will do, and what would happen if.

Everything here starts from the live version and changes nothing: a forecast simulates on from the
newest measured state, a scenario simulates beside a baseline.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.ahead.basis import Basis as Basis
    from evertwin.ahead.docking import dock as dock
    from evertwin.ahead.forecasting import Forecast as Forecast, forecast as forecast
    from evertwin.ahead.basis import Mode as Mode
    from evertwin.ahead.planned import Planned as Planned
    from evertwin.ahead.whatif import WhatIf as WhatIf
    from evertwin.sources.texts.small_table import read_table as read_table

__getattr__ = surface(__name__)
