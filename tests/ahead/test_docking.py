"""Docking at a second machine: the error told is that of the co-simulation, mistakes are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.docking import Partner, _axes, _Plan, approach, cosimulate
from evertwin.ahead.spec import SCENARIO, DockSpec, ScenarioSpec
from evertwin.config import spec
from evertwin.errors import ConfigError, EvertwinError, UsageError
from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout
from planted.draws import first_of

CARRIAGE = 'schema = 1\nname = "carriage"\n[model]\nkind = "robot1d"\n'


def cart() -> dict[str, np.ndarray]:
    """A cart that drives as told and ends at 2.0 m, measured to 1 mm."""
    t = 0.1 * np.arange(200)
    v = np.where(np.arange(200) < 100, 0.2, 0.0)
    x = np.r_[0.0, np.cumsum(0.1 * v[:-1])]
    return {"t": t, "v": v, "x": x + np.random.default_rng(0).normal(0.0, 1e-3, 200)}


def robot() -> Twin:
    return Twin(TwinSpec("robot", spec.ModelSpec("robot1d")))


class Raw(str):
    """TOML as it stands."""

    __repr__ = str.__str__


def dock(folder: Path, **keys: object) -> ScenarioSpec:
    (folder / "carriage.toml").write_text(CARRIAGE)
    told = {"machine": str(folder / "carriage.toml"), "dock": [4.0, 0, 0], "speed": "0.2 m/s"}
    lines = [f"{k} = {v!r}" for k, v in ({**told, "step": "1 s"} | keys).items()]
    text = 'schema = 1\nname = "d"\n[docking]\n' + "\n".join(lines)
    return SCENARIO.parse(text, "dock.toml")


def test_the_drive_arrives_in_the_time_of_its_way(tmp_path: Path) -> None:
    docked = robot().whatif(dock(tmp_path), cart()).docking
    assert docked["seconds"] == pytest.approx(2.0 / 0.2 + 2, abs=1.0)
    assert docked["simulated_error"] < 1e-6
    assert docked["holds"] is True and docked["error95"] < 0.01
    assert np.max(np.asarray(docked["commands"])[:, 0]) <= 0.2


def test_a_dock_that_moves_is_met_where_it_will_be(tmp_path: Path) -> None:
    moved = dock(tmp_path, output="x", lift=0.5, command=Raw("{ v = 0.04 }"))
    docked = robot().whatif(moved, cart()).docking
    # the carriage starts at 0 and has gone 0.04 m/s for all steps, half of it reaches the dock
    assert docked["dock"][0] == pytest.approx(4.0 + 0.5 * 0.04 * docked["seconds"], abs=0.03)
    assert docked["robot"][0] == pytest.approx(docked["dock"][0], abs=1e-6)


def test_a_dock_behind_is_reached_backwards(tmp_path: Path) -> None:
    docked = robot().whatif(dock(tmp_path, dock=[1.0, 0, 0]), cart()).docking
    assert docked["simulated_error"] < 1e-6
    assert np.min(np.asarray(docked["commands"])[:, 0]) < 0.0


def test_both_machines_see_the_other_one_step_late() -> None:
    model = robot().model
    one = Partner(model, model.parameters.values, model.initial(model.parameters.values))
    seen: list[tuple[float, float]] = []

    def tell(step: int, y: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        seen.append((float(y[0]), float(w[0])))
        return np.array([1.0]), np.array([2.0])

    y, w = cosimulate(one, one, tell, 0.5, 4)
    assert np.isnan(seen[0]).all()
    assert seen[1:] == list(zip(y[:-1, 0].tolist(), w[:-1, 0].tolist(), strict=True))
    assert w[-1, 0] == pytest.approx(2.0 * y[-1, 0])


@pytest.mark.parametrize(
    ("keys", "error", "says"),
    [
        ({"dock": [1e6, 0, 0]}, UsageError, "more than 120 s: raise its limit or its speed"),
        ({"machine": "nope.toml"}, EvertwinError, "nope.toml"),
        ({"output": "xx"}, EvertwinError, "xx"),
    ],
)
def test_a_docking_that_cannot_be_is_told_why(
    tmp_path: Path, keys: dict[str, object], error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        robot().whatif(dock(tmp_path, **keys), cart())


def test_a_dock_has_a_heading(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"expected x \[m\], y \[m\] and heading .*got 2 numbers"):
        dock(tmp_path, dock=[1.0, 2.0])


@pytest.mark.parametrize("key", ["speed", "step", "limit", "tolerance"])
@pytest.mark.parametrize("value", [0, -1])
def test_sizes_must_be_above_zero(tmp_path: Path, key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"{key}: expected a number above 0"):
        dock(tmp_path, **{key: value})


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("command", "{ v = nan }", "nan"),
        ("command", "{ w = 0.5 }", "'w'"),
        ("arrived", "{ w = 0.5 }", "'w'"),
    ],
)
def test_what_the_second_machine_is_told_must_be_its_inputs(
    tmp_path: Path, key: str, value: str, says: str
) -> None:
    with pytest.raises(EvertwinError, match=says):
        robot().whatif(dock(tmp_path, **{key: Raw(value)}), cart())


def test_an_arm_cannot_dock(tmp_path: Path) -> None:
    arm = Twin(TwinSpec("arm", spec.ModelSpec("arm", {"urdf": "ur5_like", "law": "sign"})))
    still = {name: np.zeros(40) for name in (*arm.model.inputs.names, *arm.model.outputs.names)}
    still["t"] = np.arange(40) * 0.1
    with pytest.raises(UsageError, match="expected a mobile base"):
        arm.whatif(dock(tmp_path), still)


def sluggish(zone: float, pole: float, way: float, speed: float) -> _Plan:
    """A cart on a line that starts to move at ``zone`` [m/s], and a dock that stands still."""

    def step(x, u, dt, p):
        told = np.sign(u[0]) * max(abs(u[0]) - p[0], 0.0)
        v = x[1] + pole * (told - x[1])
        return [x[0] + dt * v, v], [x[0] + dt * v]

    states, x = Layout.of(x="m", v="m/s"), Layout.of(x="m")
    parameters = Parameters.of(zone=(zone, "m/s"))
    model = FunctionModel(step, Layout.of(v="m/s"), x, states, parameters)
    still = robot().model
    one = Partner(model, model.parameters.values, np.zeros(2))
    other = Partner(still, still.parameters.values, still.initial(still.parameters.values))
    rule = DockSpec(machine="", dock=(way, 0.0, 0.0), speed=speed, step=0.5, limit=1e4)
    return _Plan(one, other, rule, _axes(model))


@first_of("seed", range(100))
def test_a_dock_below_the_dead_zone_is_refused_at_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zone, pole, way = rng.uniform(0.02, 0.2), rng.uniform(0.2, 1.0), rng.uniform(-3.0, 3.0)
    with pytest.raises(UsageError, match=r"cannot be reached.*does not move"):
        approach(sluggish(zone, pole, way, zone * rng.uniform(0.3, 0.99)))
    plan = sluggish(zone, pole, way, zone * rng.uniform(1.3, 3.0))
    y, _ = plan.run(approach(plan))
    assert y[-1, 0] == pytest.approx(way, abs=1e-6)
