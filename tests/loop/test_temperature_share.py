"""A share of a temperature is one of its range: a heated box through a whole twin."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin import RunResult, Twin, TwinSpec
from evertwin.config import spec
from evertwin.machines.thermal import ThermalBox
from planted.draws import first_of

ROOM, ROWS = 293.15, 900


def run(cooling: float, seed: int) -> RunResult:
    """Half an hour in its room, heated for ten minutes in each twenty from then on; the box loses
    ``cooling`` times what the model says."""
    box, rng = ThermalBox(wall=False), np.random.default_rng(seed)
    t = 6.0 * np.arange(ROWS)
    heater = np.where((t > 1800.0) & (t % 1200.0 < 600.0), 1.0, 0.0)
    p = box.parameters.values.copy()
    p[box.parameters.names.index("box_conductance")] *= cooling
    u = np.column_stack([heater, np.full(ROWS, ROOM)])
    _, y = box.simulate(np.full(2, ROOM), u, np.full(ROWS, 6.0), p)
    twin = Twin(
        TwinSpec(
            "box",
            spec.ModelSpec("thermal", options={"wall": False}),
            beat=spec.Span(20),
            prediction=spec.PredictionSpec(horizon=600.0),
            anomaly=spec.AnomalySpec(requirement=0.05, window=spec.Span(200)),
        )
    )
    noisy = y[:, 0] + rng.normal(0.0, 0.05, ROWS)
    return twin.run({"t": t, "heater": heater, "room": u[:, 1], "box": noisy})


@first_of("seed", range(3))
@pytest.mark.parametrize(("cooling", "suspected"), [(1.0, False), (3.0, True)])
def test_a_box_is_off_by_a_share_of_what_it_warms_up_by(
    cooling: float, suspected: bool, seed: int
) -> None:
    """At rest in its room, where it is off by more than its whole range, nothing is told."""
    result = run(cooling, seed)
    kinds = [event.kind for event in result.events]
    assert ("suspected" in kinds) is suspected, kinds
    if not suspected:
        assert result.outputs["box"].relative_rms_after == pytest.approx(0.05 / 20.0, rel=2.0)
