"""A machine that several inputs drive, or several outputs of which act on each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from evertwin.app.cli import app
from evertwin.app.first.init_command import Said, write_starter
from evertwin.config import read
from evertwin.errors import UsageError
from evertwin.setup.configured_model import model_of
from evertwin.twin import Twin
from planted.draws import first_of

N = 3000


def steps(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    return np.repeat(rng.uniform(low, high, N // 50), 50)


def extruder(seed: int) -> np.ndarray:
    """Time, three heaters, three zones that warm each other, and what is around."""
    rng, size = np.random.default_rng(seed), np.random.default_rng(seed + 99).uniform(0.5, 2.0)
    h = np.stack([steps(rng, 0.0, 100.0) for _ in range(3)], axis=1)
    y, zone = np.empty((N, 3)), np.array([150.0, 170.0, 180.0])
    for i in range(N):
        around = np.diff(zone, prepend=zone[0], append=zone[-1])
        zone = zone + 5.0 * size * (
            0.008 * h[i] - 0.002 * (zone - 22.0) + 0.0012 * (around[1:] - around[:-1])
        )
        y[i] = zone
    y += rng.normal(0.0, 0.1, y.shape)
    return np.column_stack([5.0 * np.arange(N), h, y, np.full(N, 22.0)])


def tank(seed: int) -> np.ndarray:
    """Time, a pump, a valve, and the level, which falls by its root."""
    rng, level, y = np.random.default_rng(seed), 0.8, np.empty(N)
    pump, valve = steps(rng, 0.0, 0.012), steps(rng, 5.0, 60.0)
    for i in range(N):
        level = max(level + pump[i] - 2e-4 * valve[i] * np.sqrt(level), 0.0)
        y[i] = level
    return np.column_stack([np.arange(N), pump, valve, y + rng.normal(0.0, 0.002, N)])


def room(seed: int) -> np.ndarray:
    """Time, heater, sun, what is outside, and the room."""
    rng, warm, y = np.random.default_rng(seed), 18.0, np.empty(N)
    heater, sun = steps(rng, 0.0, 100.0), steps(rng, 0.0, 700.0)
    outside = 5.0 + 5.0 * np.sin(np.arange(N) / 230.0)
    for i in range(N):
        warm += 60.0 * (1e-5 * heater[i] + 1e-6 * sun[i] - 4e-5 * (warm - outside[i]))
        y[i] = warm
    return np.column_stack([60.0 * np.arange(N), heater, sun, outside, y + rng.normal(0, 0.03, N)])


def drive(seed: int) -> np.ndarray:
    """Time, a motor's current as it was measured, the load, and the speed."""
    rng, speed, y = np.random.default_rng(seed), 0.0, np.empty(N)
    current, load = steps(rng, -6.0, 6.0), steps(rng, -2.0, 2.0)
    for i in range(N):
        speed += 0.5 * (0.35 * current[i] - 0.5 * load[i] - 0.02 * speed)
        y[i] = speed
    noise = rng.normal(0.0, (0.02, 0.1), (N, 2))
    return np.column_stack([0.01 * np.arange(N), current + noise[:, 0], load, y + noise[:, 1]])


MACHINES = {
    "t,h1,h2,h3,t1,t2,t3,ambient": (extruder, "h1 h2 h3", "t1 t2 t3"),
    "t_s,inlet_pump,outlet_valve_pct,level_m": (tank, "inlet_pump outlet_valve_pct", "level_m"),
    "Zeit [s],Heizung [%],Sonne [W/m2],Aussentemp [°C],Raumtemp [°C]":
        (room, "aussentemp heizung sonne", "raumtemp"),
    "t [s],motor current [A],load torque [Nm],speed [rad/s]":
        (drive, "load_torque motor_current", "speed"),
}  # fmt: skip


def recorded(heading: str, table: np.ndarray, folder: Path) -> Path:
    np.savetxt(folder / "run.csv", table, "%.6g", ",", header=heading, comments="")
    return folder / "run.csv"


@first_of("seed", [1, 2])
@pytest.mark.parametrize("heading", MACHINES)
def test_every_input_and_output_is_in_the_model_which_starts_near_the_machine(
    heading: str, seed: int, tmp_path: Path
) -> None:
    drawn, inputs, outputs = MACHINES[heading]
    file = recorded(heading, drawn(seed), tmp_path)
    write_starter([file], tmp_path / "new.toml", ("", None), force=False, as_json=False)
    spec = read(tmp_path / "new.toml")
    model = model_of(spec)
    assert sorted(model.inputs.names) == inputs.split()
    assert sorted(model.outputs.names) == outputs.split()
    with Twin(spec) as twin:
        result = twin.run([file])
    assert str(result).startswith("The twin fits its machine, and nothing was changed"), result


def test_what_is_not_told_is_asked_and_answered_by_a_list(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    table = extruder(1)[:, :7]
    table[:, 1:4] += rng.normal(0.0, 0.5, (N, 3))  # as they were measured: not in steps
    file = recorded("t,a,b,c,d,e,f", table, tmp_path)
    out = tmp_path / "new.toml"
    asked = CliRunner().invoke(app, ["init", str(file), "-o", str(out)])
    assert "u: column" in asked.output and '--answer u.column="COLUMN, COLUMN"' in asked.output
    said = Said(answers=("u.column=a, b, c", "y.column=d, e, f"))
    write_starter([file], out, ("", None), force=True, as_json=False, said=said)
    model = model_of(read(out))
    assert (model.inputs.names, model.outputs.names) == (("a", "b", "c"), ("d", "e", "f"))
    wrong = Said(answers=("u.column=a, nothing",))
    with pytest.raises(UsageError, match="there is no column 'nothing'"):
        write_starter([file], out, ("", None), force=True, as_json=False, said=wrong)


def test_what_was_measured_holds_for_the_row_that_says_it_and_a_command_from_then_on(
    tmp_path: Path,
) -> None:
    file = recorded("t [s],motor current [A],load torque [Nm],speed [rad/s]", drive(1), tmp_path)
    write_starter([file], tmp_path / "new.toml", ("", None), force=False, as_json=False)
    held = {name: one.hold for name, one in read(tmp_path / "new.toml").signals.items()}
    assert held == {"motor_current": False}


def test_what_a_controller_is_told_does_not_drive_beside_what_it_puts_out(tmp_path: Path) -> None:
    table = tank(1)
    wanted = np.repeat(np.random.default_rng(5).uniform(0.2, 0.9, N // 100), 100)
    table = np.column_stack([table, wanted])
    heading = "t [s],pump [m3/s],valve [%],level [m],level setpoint [m]"
    file = recorded(heading, table, tmp_path)
    write_starter([file], tmp_path / "new.toml", ("", None), force=False, as_json=False)
    assert model_of(read(tmp_path / "new.toml")).inputs.names == ("pump", "valve")


def test_an_effort_beside_what_is_set_is_what_that_takes(tmp_path: Path) -> None:
    """A belt slips the more it carries; its motor's current goes with its speed at once."""
    rng, speed, y = np.random.default_rng(3), 0.0, np.empty(N)
    asked, load = steps(rng, 0.0, 1500.0), steps(rng, 0.0, 80.0)
    for i in range(N):
        speed += 0.25 * (asked[i] / 1500.0 - speed)
        y[i] = speed * (0.98 - 0.002 * load[i])
    current = 1.2 + 0.03 * load + 4.0 * y + rng.normal(0.0, 0.05, N)
    table = np.column_stack(
        [0.1 * np.arange(N), asked, load, y + rng.normal(0.0, 0.004, N), current]
    )
    heading = "sec,drive setpoint 1/min,load kg,belt speed m/s,current A"
    log, twin = recorded(heading, table, tmp_path), tmp_path / "twin.toml"
    write_starter([log], twin, ("", None), False, False, Said())
    found = read(twin)
    model = model_of(found)
    assert list(model.inputs.names) == ["drive_setpoint_1_min", "load"]
    assert "belt_speed" in model.outputs.names


def test_records_side_by_side_are_no_one_machine(tmp_path: Path) -> None:
    rng, table = np.random.default_rng(4), [4.0 * np.arange(N)]
    for _ in range(2):
        u, y, level = steps(rng, 1.0, 6.0), np.empty(N), 4.0
        for i in range(N):
            level += 0.05 * (u[i] - level)
            y[i] = level
        table += [u, y]
    heading = "t [s],uEst,yEst,uVal,yVal"
    log, twin = recorded(heading, np.column_stack(table), tmp_path), tmp_path / "new.toml"
    write_starter([log], twin, ("", None), force=False, as_json=False)
    assert model_of(read(twin)).outputs.names == ("y",)
