"""What a fit says of the requirement, and of recordings that it has not learned from."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from evertwin import Twin
from evertwin.config.spec import AnomalySpec, ModelSpec, PredictionSpec, TwinSpec
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from planted.draws import first_of


def stiffening(x: Any, u: Any, dt: float, p: Any) -> Any:
    new = x[0] + dt * (u[0] - p[0] * x[0])
    return [new], [new]


def recording(seed: int, force: float, cubic: float) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-force, force, 60), 10)
    x = np.zeros(len(u))
    for i in range(1, len(u)):
        x[i] = x[i - 1] + 0.1 * (u[i - 1] - x[i - 1] - cubic * x[i - 1] ** 3)
    return {"t": 0.1 * np.arange(len(u)), "u": u, "x": x + rng.normal(0, 0.002, len(u))}


def spring(requirement: float) -> Twin:
    """A spring that is held to so many metres, predicted 2 s ahead."""
    model = FunctionModel(
        stiffening, Layout.of(u="m/s"), Layout.of(x="m"), Layout.of(x="m"),
        Parameters.of(k=(0.8, "1/s")),
    )  # fmt: skip
    spec = TwinSpec(
        "spring", ModelSpec("python"), prediction=PredictionSpec(horizon=2.0),
        anomaly=AnomalySpec(requirement=requirement, relative=False),
    )  # fmt: skip
    return Twin(spec, model)


@first_of("seed", range(4))
@pytest.mark.parametrize(("cubic", "holds"), [(0.0, True), (0.6, False)])
def test_the_requirement_is_told_of_the_tests(seed: int, cubic: float, holds: bool) -> None:
    small, large = recording(seed, 0.2, cubic), recording(seed + 100, 2.0, cubic)
    found = spring(0.01).fit(small, [large])
    text, told = str(found), found.to_dict()
    assert told["holds"] is holds and told["requirement"]["reached"] is holds
    assert text.startswith("does not hold on data it has not seen: x is off") is not holds
    assert f"requirement on the tests: {'' if holds else 'not '}reached: x is off by" in text
    assert "requirement on what it learned from: reached" in str(spring(0.01).fit(small))


@pytest.mark.parametrize(("rows", "known"), [(2, False), (6, False), (40, True)])
def test_few_values_tell_no_requirement(rows: int, known: bool) -> None:
    """As many numbers as values leave nothing, whatever the machine."""
    few = {name: column[:rows] for name, column in recording(3, 0.2, 0.0).items()}
    found = spring(0.02).fit(few)
    assert found.to_dict()["requirement"]["reached"] is known
    assert ("not known, for too few values tell it" in str(found)) is not known
