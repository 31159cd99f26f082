"""What tuning is worth beside a reading of a gauge: all that the rows tell, whatever acts alike."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.fold import make_block
from evertwin.gauges.settled import settled
from evertwin.machines.drive import DriveForce
from evertwin.tuning import Problem

NOISE = 0.05


@pytest.mark.parametrize("seed", range(5))
def test_of_terms_that_act_alike_on_the_rows_one_takes_what_they_explain(seed: int) -> None:
    """A friction that goes with the place is like dry friction on a short way; both stayed where
    they were, so a unit that was never wrong explained more than tuning."""
    rng = np.random.default_rng(seed)
    t = np.arange(400) * 0.02
    w, way = rng.uniform(1.0, 3.0), 0.02
    q, v, a = way * np.sin(w * t), way * w * np.cos(w * t), -way * w * w * np.sin(w * t)
    axis = DriveForce("sign+direction+two_sided+stribeck+root+position+spring")
    names = tuple(n for n in axis.parameters.names if n not in ("vs", "wave"))
    truth = {"mass": rng.uniform(1.0, 3.0), "Fv": 4.0, "Fc": rng.uniform(2.0, 5.0), "Fc_minus": 1.0}
    rows = {"position": q, "speed": v, "acceleration": a}
    u = np.stack([rows[name] for name in axis.inputs.names], axis=1)
    p = axis.parameters.with_values(truth).values
    y = axis.simulate(np.zeros(0), u, np.full(len(t), 0.02), p)[1]
    block = make_block(t=(t * 1e9).astype(np.int64), u=u, y=y + rng.normal(0.0, NOISE, y.shape))
    start = axis.parameters.with_values({"mass": 1.0, "Fc": 1.0})
    fit = settled(Problem(axis, (block,), names, prior=start))
    assert fit.residuals[0].rms_after < 1.2 * NOISE
