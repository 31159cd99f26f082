"""Looking ahead: what the machine will do, and what would happen if.

Everything here starts from the live version and changes nothing: a forecast simulates on from the
newest measured state, a scenario simulates beside a baseline.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.ahead.basis import Basis
    from evertwin.ahead.docking import dock
    from evertwin.ahead.forecasting import Forecast, forecast
    from evertwin.ahead.future import Mode
    from evertwin.ahead.paths import rows_of_file
    from evertwin.ahead.whatif import WhatIf
    from evertwin.sources.small_table import read_table

__all__ = ["Basis", "Forecast", "Mode", "WhatIf", "dock", "forecast", "read_table", "rows_of_file"]

__getattr__ = surface(__name__)
