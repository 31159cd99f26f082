"""What is answered beside a running twin: why it tunes what it tunes, version against version."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from evertwin.config import TwinSpec, read
from evertwin.errors import DataError, UsageError
from evertwin.fold import Block, make_block
from evertwin.service.views.tuning_choice import UNTOLD, engineered
from evertwin.service.views.version_comparison import Pair, compared
from evertwin.twin import Twin

BREAKDOWN = """
schema = 1
name = "cart"
[model]
kind = "robot1d"
names = "{parameter}"
[sensors.x]
measures = "where the cart is"
[[system]]
name = "drive"
[[system.component]]
name = "gearbox"
kind = "gearbox"
effect = 4
proneness = 4
physics = "a factor"
sensors = ["x"]
parameters.gain = { value = 1.0, low = 0.5, high = 1.5 }
wear = [{ effect = "abrasion", parameters = ["gain"], drift = "20 %" }]
"""
CART = """
schema = 1
name = "cart"
beat = 20
[model]
kind = "robot1d"
parameters.gain = { value = 1.0, low = 0.5, high = 1.5 }
[prediction]
horizon = "5 s"
[anomaly]
requirement = "1 cm"
window = 100
[tuning]
weights = { gain = 0.5 }
[store]
path = "cart.db"
"""


def rows(tasks: int = 2) -> Sequence[Block]:
    """Tasks of a cart that drives 10 % too fast."""
    rng = np.random.default_rng(1)
    v = np.repeat(rng.uniform(0.0, 0.2, 60), 10)
    x = np.r_[0.0, np.cumsum(1.1 * v[:-1])] + rng.normal(0.0, 0.002, 600)
    t = np.arange(600) * 10**9
    return [make_block(t=t[part], u=v[part, None], y=x[part, None])
            for part in np.split(np.arange(600), tasks)]  # fmt: skip


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> TwinSpec:
    """A twin whose second version is better."""
    folder = tmp_path_factory.mktemp("cart")
    (folder / "cart.toml").write_text(CART)
    (folder / "parts.toml").write_text(BREAKDOWN)
    with Twin(read(folder / "cart.toml")) as twin:
        twin.run(rows(1))
        assert twin.champion.number >= 1
    return read(folder / "cart.toml")


def column(told: Sequence[float | None]) -> np.ndarray:
    """What is not a number is None in the answer."""
    return np.array([np.nan if value is None else value for value in told])


def with_parts(cart: TwinSpec) -> TwinSpec:
    """The same twin, whose file names a breakdown."""
    file = Path(cart.folder) / "cart.toml"
    file.write_text(CART + '[prognosis]\nbreakdown = "parts.toml"\n')
    return read(file)


def test_it_says_why_it_tunes_what_it_tunes(cart: TwinSpec) -> None:
    found = engineered(with_parts(cart), rows())
    (part,) = found["components"]
    assert (part["component"], part["score"], part["role"]) == ("gearbox", 16.0, "critical")
    (choice,) = found["parameters"]
    assert choice["name"] == "gain" and choice["editable"] and choice["share"] > 0.9
    assert found["tuned"] == {"parameters": {"gain": 0.5}, "every": None}
    assert 0.0 < found["schedule"]["weights"]["gain"] <= 1.0 and found["measured"] is None
    assert found["span"] == pytest.approx(598.0) and found["version"] >= 1


def test_without_a_breakdown_what_cannot_be_told_is_said(cart: TwinSpec) -> None:
    found = engineered(cart, rows())
    assert found["components"] == () and found["notes"] == UNTOLD
    (link,) = found["links"]
    assert link["parameter"] == "gain" and link["signals"][0]["signal"] == "x"


def test_two_versions_are_compared_run_by_run(cart: TwinSpec) -> None:
    found = compared(cart, rows(), Pair(0, 1, "x"))
    with Twin(cart, reading=True) as twin:
        whole = twin.compare(0, 1, rows())
    assert [run["rows"] for run in found["runs"]] == [300, 300]
    for k, told in enumerate(whole.deviations):
        mean = np.mean([run["rms"]["x"][k] ** 2 for run in found["runs"]])
        assert np.sqrt(mean) == pytest.approx(told[0].rms, rel=1e-2)
        residual = column(found["measured"]) - column(found["predicted"][k])
        np.testing.assert_allclose(residual, column(found["residual"][k]), atol=1e-12)
    assert all(b < a for a, b in (run["rms"]["x"] for run in found["runs"]))
    assert len(compared(cart, rows()[:1], Pair(0, 1, "x"))["runs"]) == 8


def test_what_cannot_be_compared_says_what_can(cart: TwinSpec) -> None:
    for pair, word in ((Pair(0, 99, "x"), "0 to"), (Pair(0, 1, "y"), "there are x")):
        with pytest.raises(UsageError, match=word):
            compared(cart, rows(), pair)
    with pytest.raises(DataError, match="no rows"):
        compared(cart, [], Pair(0, 1, "x"))
