"""The doctor: what is wrong with a twin or its data, or will be, before anything is learned.

Each look is a function from a `View` (the twin and its rows) to findings, each with what was found,
where, why, and the next step. Nothing is changed.

* `look_data`: clocks, gaps, frozen and absurd channels, lost rows;
* `look_samples`: held values, recordings that are there twice;
* `look_rates`: positions against the speeds that were measured with them;
* `look_units`: factors, signs and lags between what is predicted and what is measured;
* `look_inputs`: measured inputs that are taken for commands;
* `look_roles`: a sensor of several in the place of one beside the machine;
* `look_pose`: a pose that is measured elsewhere, or carried along;
* `look_clocks`: offset, drift and shared lag between the clocks of two or more sources;
* `look_tuning`: what the rows determine of the parameters, knobs and bounds;
* `look_hidden`: changes of the machine that stay within what is asked;
* `look_settings`: horizon, tolerance, requirement and action space against noise and range.
"""

from __future__ import annotations

from evertwin.doctor.check_clocks import look_clocks
from evertwin.doctor.check_data import look_data
from evertwin.doctor.check_inputs import look_inputs
from evertwin.doctor.check_pose import look_pose
from evertwin.doctor.check_rates import look_rates
from evertwin.doctor.check_samples import look_samples
from evertwin.doctor.check_settings import look_bounds, look_settings, look_tuning
from evertwin.doctor.check_units import look_lags, look_units
from evertwin.doctor.examination import View, view
from evertwin.doctor.finding import Diagnosis, Finding
from evertwin.doctor.hidden_changes import look_hidden
from evertwin.doctor.swapped_roles import look_roles
from evertwin.ledger.versions import Versions
from evertwin.rows.feed import Data
from evertwin.setup.setup import Setup

__all__ = ["Diagnosis", "Finding", "diagnose"]


def diagnose(setup: Setup, versions: Versions, number: int, data: Data) -> Diagnosis:
    """Everything that can be told about version ``number`` and ``data``.

    Without recordings, neither given nor named by the twin file, only the twin itself is looked at.

    Raises:
        DataError: a recording cannot be read.
    """
    name, version = setup.spec.name, versions[number]
    if data is None and not any(source.files for source in setup.spec.source):
        return Diagnosis(name, 0, tuple(look_bounds(setup, versions, version)), {})
    seen: View = view(setup, versions, number, data)
    figures: dict[str, object] = {}
    if seen.slow and seen.rows > seen.most:
        figures["simulated_rows"] = sum(len(window.t) for window in seen.simulated)
        figures["judged_rows"] = sum(len(window.t) for window in seen.judged)
    found = [*look_data(seen), *look_samples(seen), *look_rates(seen, figures)]
    found += look_roles(seen)
    late = [*look_inputs(seen)]
    units = [] if late else look_units(seen, figures)  # a row late, changes have another size
    found += late + units
    if not units:
        found += look_lags(seen, figures)
        found += look_clocks(seen, figures)
        found += look_pose(seen)
    found += look_bounds(setup, versions, version)
    found += look_tuning(seen, figures)
    found += look_hidden(seen, figures)
    found += look_settings(seen, figures)
    found.sort(key=lambda one: one.kind != "not_connected")  # what no data mends comes first
    return Diagnosis(name, seen.rows, tuple(found), figures)
