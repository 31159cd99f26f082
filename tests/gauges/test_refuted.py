"""What was said of a channel is taken back where later rows refute it, however rough the twin."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.spec import ModelSpec, TwinSpec
from evertwin.fold import Windows, make_block
from evertwin.gauges.refuted import refuted
from evertwin.models import FunctionModel, Parameters
from evertwin.models.functions.translated import translated
from evertwin.outcome import RunResult
from evertwin.setup.setup import Setup
from evertwin.setup.task import Doubt
from evertwin.signals import Layout
from evertwin.sources.spec import ChannelSpec, SourceSpec
from evertwin.tuning import Problem
from evertwin.types import ParameterVector, Vector
from planted.draws import first_of

Columns = dict[str, Vector]
WAYS = (np.cos, np.sin)

TWIN = """schema = 1
name = "hoist"
beat = "5 s"
[model]
kind = "drive_force"
options = { law = "sign", standstill = 0.02 }
[model.parameters]
mass = { value = 236, editable = false }
Fc = { value = 190, low = 0, high = 2000 }
Fv = { value = 420, low = 0, high = 5000 }
offset = { value = 2315, low = 0, high = 5000 }
[[source]]
name = "drive"
[source.channels]
speed = { column = "speed", unit = "m/s" }
acceleration = { column = "acceleration", unit = "m/s^2" }
force = { column = "force", unit = "N" }
[moving]
above = "3 cm/s"
[moving.channels]
force = "speed"
[prediction]
horizon = "1 s"
[anomaly]
requirement = 0.003
window = "60 s"
[tuning]
editable = ["Fc", "Fv", "offset"]
window = "60 s"
"""
"""Asked for less than its force scatters by: no version ever holds."""


def hoisted(folder: Path, seed: int, turned: slice) -> RunResult:
    """15 min at 10 Hz; rubs more from 10 min on. ``turned``: rows in which the force's sign is."""
    rng, n = np.random.default_rng(seed), 9000
    v = np.zeros(n)
    for k in range(0, n, 60):
        way = np.clip(np.minimum(np.arange(60), 44 - np.arange(60)) / 10.0, 0.0, 1.0)
        v[k : k + 60] = rng.choice([-1, 1]) * rng.uniform(0.2, 0.6) * way[: n - k]
    a = np.gradient(v, 0.1)
    rubs = np.where(np.arange(n) < 6000, 190.0, 330.0)
    f = 236.0 * (9.81 + a) + np.sign(v) * rubs + 420.0 * v + rng.normal(0.0, 15.0, n)
    f[turned] *= -1.0
    speed = v + rng.normal(0.0, 1e-3, n) * (v != 0.0)
    seen = {"speed": speed, "acceleration": a + rng.normal(0.0, 0.01, n), "force": f}
    (folder / "hoist.toml").write_text(TWIN)
    with Twin.open(folder / "hoist.toml") as twin:
        return twin.run({"t": 0.1 * np.arange(n), **seen})


@first_of("seed", range(3))
def test_a_sign_that_is_right_again_is_in_doubt_no_longer(tmp_path: Path, seed: int) -> None:
    result = hoisted(tmp_path, seed, slice(2000, 3000))
    assert "the sign of force looks turned" in result.of_kind("abnormal")[0].reason
    (cleared,) = [e for e in result.of_kind("normal") if "doubt" in e.evidence]
    assert cleared.signal == "force" and 3000 < cleared.row < 5000
    assert any("Fc" in e.reason for e in result.of_kind("promoted") if e.row > 6000)
    assert "turned" not in result.headline
    assert abs(result.parameters["Fc"].value - 330.0) < 15.0


@first_of("seed", range(3))
def test_a_sign_that_stays_turned_stays_in_doubt(tmp_path: Path, seed: int) -> None:
    result = hoisted(tmp_path, seed, slice(2000, None))
    assert "the sign of force looks turned" in result.headline
    assert not [e for e in result.of_kind("normal") if "doubt" in e.evidence]
    assert not [e for e in result.of_kind("promoted") if e.row > 2000]


BASE = """schema = 1
name = "base"
beat = "2 s"
[model]
kind = "differential"
[[source]]
name = "log"
[source.channels]
v = { column = "v", unit = "m/s" }
w = { column = "w", unit = "rad/s" }
x = { column = "x", unit = "m" }
y = { column = "y", unit = "m" }
heading = { column = "heading", unit = "rad" }
[prediction]
horizon = "1 s"
[anomaly]
requirement = "1 cm"
relative = false
outputs = ["x", "y", "heading"]
window = "100 s"
"""
FROM, ROWS, STEP = 1500, 2800, 0.1


def driven(folder: Path, seed: int, fault: Callable[[Columns], None], slow: int = 0) -> RunResult:
    """Of a base at 10 Hz, and a fault from FROM on, where it hardly turns on ``slow`` rows."""
    rng, hold = np.random.default_rng(seed), 30
    v = np.repeat(rng.uniform(-0.15, 0.5, ROWS // hold + 1), hold)[:ROWS]
    w = np.repeat(rng.uniform(-0.6, 0.6, ROWS // hold + 1), hold)[:ROWS]
    w[FROM : FROM + slow] = rng.uniform(0.005, 0.008, slow)
    heading = np.concatenate([[0.0], np.cumsum(STEP * w)])
    mean = 0.5 * (heading[1:] + heading[:-1])
    x, y = (np.concatenate([[1.0], 1.0 + np.cumsum(STEP * v * f(mean))])[:-1] for f in WAYS)
    seen = {"v": v, "w": w, "x": x, "y": y, "heading": heading[:-1]}
    seen |= {name: seen[name] + rng.normal(0.0, 0.002, ROWS) for name in ("x", "y", "heading")}
    fault({name: column[FROM:] for name, column in seen.items()})
    (folder / "base.toml").write_text(BASE)
    with Twin.open(folder / "base.toml") as twin:
        return twin.run({"t": STEP * np.arange(ROWS), **seen})


def exchanged(late: Columns) -> None:
    late["x"][:], late["y"][:] = late["y"].copy(), late["x"].copy()


def scaled(late: Columns) -> None:
    late["x"] *= 1.1


def degrees(late: Columns) -> None:
    late["w"] *= 180.0 / np.pi


def accused(result: RunResult) -> list[str]:
    """Channels that were accused, and that were said to be in doubt no longer, in order."""
    return [
        ("not " if "doubt" in one.evidence else "") + one.signal
        for one in sorted(result.of_kind("abnormal", "normal"), key=lambda one: one.row)
        if one.signal and {"number", "doubt"} & set(one.evidence)
    ]


@pytest.mark.parametrize("fault", [exchanged, scaled])
@first_of("seed", [1, 2, 3])
def test_rows_before_a_fault_and_outputs_without_it_refute_nothing(
    tmp_path: Path, fault: Callable[[Columns], None], seed: int
) -> None:
    result = driven(tmp_path, seed, fault)
    assert accused(result) == ["x"]
    assert not result.of_kind("promoted")


def test_a_heading_that_moves_again_is_in_doubt_no_longer(tmp_path: Path) -> None:
    result = driven(tmp_path, 2, degrees, slow=60)
    assert accused(result) == ["heading", "not heading"]
    assert result.headline.startswith("w has been in error since row 1561")
    assert "degrees for radians" in result.headline


def cooled(x: Vector, u: Vector, dt: float, p: ParameterVector) -> tuple[list[float], list[float]]:
    warm = x[0] + dt * (u[0] - p[0] * (x[0] - 288.15)) / 2e4
    return [warm], [warm]


@pytest.mark.parametrize("share", [0.8, 1.1, 1.2])
@first_of("seed", range(6))
def test_a_share_of_degrees_celsius_is_one_of_what_is_recorded(share: float, seed: int) -> None:
    """A chamber about 0 degC, whose sensor scales from half of the rows on: a share of kelvins
    explains none of it, and said that the channel is read rightly."""
    rng, n = np.random.default_rng(seed), 1200
    power, box = np.repeat(rng.uniform(-900.0, 300.0, n // 60), 60), [rng.uniform(258.0, 288.0)]
    for watts in power[1:]:
        box.append(cooled(box[-1:], [watts], 10.0, [22.0])[0][0])  # type: ignore[arg-type]
    read = np.array(box) - 273.15 + rng.normal(0.0, 0.05, n)
    read[n // 2 :] *= share
    model = translated(FunctionModel(
        cooled, Layout.of(power="W"), Layout.of(box="K"), Layout.of(box="K"),
        Parameters.of(loss=(22.0, "W/K")),
    ))  # fmt: skip
    block = make_block(np.arange(n) * 10**10, power[:, None], read[:, None] + 273.15)
    log = SourceSpec("log", {"power": ChannelSpec("p", "W"), "box": ChannelSpec("b", "degC")})
    spec = TwinSpec("chamber", ModelSpec("python"), source=(log,), anomaly=AnomalySpec(0.15))

    def pose(windows: Windows) -> Problem:
        return Problem(model, windows, horizon=600.0)

    doubt = Doubt("box", 1.0, n // 2 + 20)
    assert not refuted(Setup(spec, model), pose, ((), (block,)), doubt)
