"""Several machines carry the twins of one site: which node runs which, and for how long."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.fleet.members import Member as Member, Members as Members, Says as Says
    from evertwin.fleet.spec import FleetSpec as FleetSpec
    from evertwin.fleet.telling import fleet_told as fleet_told
    from evertwin.fleet.tenure import Step as Step, Tenure as Tenure, Told as Told

__getattr__ = surface(__name__)
