"""What stands tells nothing of friction or inertia, whatever its measured speed says."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config import TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.tuning.spec import TuningSpec

RATE, MOVES = 20.0, 2
URDF = str(files("evertwin.machines").joinpath("data", "ur5_like.urdf"))
OPTIONS = {"urdf": URDF, "law": "tanh"}


def recorded(seed: int, noise: float) -> dict[str, np.ndarray]:
    """A minute of an arm of which joint 3 alone moves; speeds scatter by ``noise`` [rad/s]."""
    rng, t = np.random.default_rng(seed), np.arange(1200) / RATE
    q, qd, qdd = np.zeros((3, len(t), 6))
    q += rng.uniform(-1.0, 1.0, 6)
    for size, pace in ((0.5, 0.9), (0.3, 0.37)):
        q[:, MOVES] += size * np.sin(pace * t)
        qd[:, MOVES] += size * pace * np.cos(pace * t)
        qdd[:, MOVES] -= size * pace**2 * np.sin(pace * t)
    motion = np.concatenate([q, qd, qdd], axis=1)
    with Twin(TwinSpec("arm", ModelSpec("arm", OPTIONS))) as twin:
        model = twin.setup.model
        p = model.parameters.values.copy()
        for j in range(1, 7):
            p[model.parameters.index(f"Fc{j}")], p[model.parameters.index(f"Fv{j}")] = 4.0, 3.0
        tau = model.simulate(model.initial(p), motion, np.full(len(t), 1 / RATE), p)[1]
    tau += 0.02 * np.sqrt(np.mean(np.square(tau), axis=0)) * rng.standard_normal(tau.shape)
    q, qd = q + 1e-5 * rng.standard_normal(q.shape), qd + noise * rng.standard_normal(q.shape)
    qdd += 10.0 * noise * rng.standard_normal(q.shape)
    columns = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    return {"t": t} | {f"{n}{j + 1}": c[:, j] for n, c in columns.items() for j in range(6)}


@pytest.mark.parametrize("noise", [8e-3, 1e-17])
def test_a_joint_that_stands_keeps_its_description(noise: float) -> None:
    names = ("Ia*", "Fv*", "Fc*", "offset*")
    tuning = TuningSpec(editable=names)
    with Twin(TwinSpec("arm", ModelSpec("arm", OPTIONS), tuning=tuning)) as twin:
        fit = twin.fit(recorded(1, noise)).fit
        prior = twin.setup.model.parameters
    own = {name for name in fit.names if name.endswith(str(MOVES + 1))}
    for name, value, verdict in zip(fit.names, fit.values.tolist(), fit.verdict, strict=True):
        if name not in own and not name.startswith("offset"):
            assert (value, verdict) == (prior[name].value, "not"), name
    assert fit["Fc3"] == pytest.approx(4.0, rel=0.02)
    assert fit["Fv3"] == pytest.approx(3.0, rel=0.1)
