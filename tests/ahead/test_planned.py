"""Inputs to come are read as the recordings are, or in the units that results are printed in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.errors import DataError
from evertwin.models.spec import ModelSpec
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec

DUTY = ChannelSpec("duty", unit="%", scale=0.5)
ROOM = ChannelSpec("room [degC]", unit="degC")
BOX = ChannelSpec("box", unit="degC")


def oven() -> Twin:
    """A box whose heater was recorded as twice its share in %, temperatures in degC."""
    channels = {"heater": DUTY, "room": ROOM, "box": BOX}
    logger = SourceSpec("log", channels=channels, time=TimeSpec("t_min", unit="min"))
    return Twin(TwinSpec("oven", ModelSpec("thermal"), source=(logger,)))


def recorded(seed: int, rows: int = 400) -> dict[str, np.ndarray]:
    """Rows in SI: half an hour with a room of 20 to 22 degC."""
    rng = np.random.default_rng(seed)
    heater = np.repeat(rng.uniform(0.1, 0.5, rows // 40), 40)
    room = 294.15 + np.sin(np.arange(rows) / 50.0)
    twin = oven()
    dt = np.full(rows, 5.0)
    u = np.ascontiguousarray(np.stack([heater, room], axis=1))
    p = twin.model.parameters.values
    _, y = twin.model.simulate(twin.model.initial(p), u, dt, p)
    box = y[:, 0] + rng.normal(0.0, 0.05, rows)
    return {"t": 5.0 * np.arange(rows), "heater": heater, "room": room, "box": box}


def planned(twin: Twin, rows: dict[str, np.ndarray], path: Path, text: str) -> np.ndarray:
    path.write_text(text)
    found: np.ndarray = twin.forecast(60.0, rows, inputs=path).inputs
    return found


@pytest.mark.parametrize("seed", range(3))
def test_columns_are_those_of_the_recordings_or_of_the_channels(seed: int, tmp_path: Path) -> None:
    twin, rows, path = oven(), recorded(seed), tmp_path / "plan.csv"
    wanted = pytest.approx(np.tile([0.3, 294.15], (2, 1)))
    own = planned(twin, rows, path, "t_min,duty,room [degC]\n0,60,21\n0.1,60,21\n")
    assert own == wanted
    assert planned(twin, rows, path, "t,heater,room\n0,30,21\n6,30,21\n") == wanted
    assert (
        planned(twin, rows, path, "t,heater [1],room [K]\n0,0.3,294.15\n6,0.3,294.15\n") == wanted
    )
    found = twin.forecast(60.0, rows, inputs=path)
    assert found.t[0] == pytest.approx(6.0) and found.notes == ()


def test_a_heading_of_another_quantity_is_refused(tmp_path: Path) -> None:
    twin, rows = oven(), recorded(0)
    with pytest.raises(DataError, match="heater is in 'A' by its heading"):
        planned(twin, rows, tmp_path / "plan.csv", "t,heater [A],room\n0,30,21\n60,30,21\n")


def planned_at(path: Path, room: float) -> Path:
    """A minute in a room [degC]."""
    path.write_text(f"t,heater,room\n0,30,{room}\n60,30,{room}\n")
    return path


@pytest.mark.parametrize("seed", range(3))
def test_inputs_beyond_what_was_recorded_are_said(seed: int, tmp_path: Path) -> None:
    twin, rows, path = oven(), recorded(seed), tmp_path / "plan.csv"
    path.write_text("t,heater,room\n0,30,294.15\n60,30,294.15\n")
    (note,) = twin.forecast(60.0, rows, inputs=path).notes
    assert "room 294.1 … 294.1 degC (recorded 20 … 22)" in note and "heater" not in note
    told = tmp_path / "hot.toml"
    told.write_text('schema = 1\nname = "hot"\n[path]\nfile = "plan.csv"\n')
    assert note in twin.whatif(told, rows).notes
    told.write_text('schema = 1\nname = "as it is"\n')
    assert not twin.whatif(told, rows).notes


def test_a_band_beyond_what_was_recorded_holds_what_was(tmp_path: Path) -> None:
    """One recorded width away it may be as if the room had stayed; nearby it is as it was."""
    twin, rows, path = oven(), recorded(0), tmp_path / "plan.csv"
    near, far = (
        twin.forecast(60.0, rows, inputs=planned_at(path, room)).outputs["box"]
        for room in (22, 300)
    )
    there = np.abs(far.value - near.value)[-1]
    assert np.ptp(near.band(0.95), axis=0)[-1] < 0.1 * there
    assert far.band(0.95)[0][-1] < near.value[-1] + 0.01 * there, "as if the room had stayed"


@pytest.mark.parametrize("seed", range(3))
def test_a_sparse_plan_is_simulated_at_the_usual_step(seed: int, tmp_path: Path) -> None:
    twin, rows, path = oven(), recorded(seed), tmp_path / "plan.csv"
    path.write_text("t,heater,room\n0,30,21\n1000,0,21\n2000,0,21\n")
    sparse = twin.forecast(60.0, rows, inputs=path)
    assert sparse.horizon == pytest.approx(2005.0) and np.allclose(np.diff(sparse.t), 5.0)
    heater = np.where(np.arange(401) < 200, 30, 0)
    path.write_text("t,heater,room\n" + "".join(f"{5 * k},{h},21\n" for k, h in enumerate(heater)))
    full = twin.forecast(60.0, rows, inputs=path)
    assert full.outputs["box"].value == pytest.approx(sparse.outputs["box"].value)


def test_a_path_between_sparse_rows_goes_on_a_line(tmp_path: Path) -> None:
    drive, path, n = Twin(TwinSpec("axis", ModelSpec("drive_force"))), tmp_path / "plan.csv", 400
    path.write_text("t,speed,acceleration,force\n0,0,0.1,0\n10,1,0.1,1e3\n")
    rows = {
        name: np.random.default_rng(k).normal(0.0, 1.0, n)
        for k, name in enumerate((*drive.model.inputs.names, *drive.model.outputs.names))
    }
    rows["t"] = 0.5 * np.arange(n)
    told = tmp_path / "sparse.toml"
    told.write_text('schema = 1\nname = "sparse"\n[path]\nfile = "plan.csv"\n')
    after = drive.whatif(told, rows).after
    assert len(after.t) == 21 and after.seconds == pytest.approx(10.5)
    u = drive.forecast(1.0, rows, inputs=path).inputs
    assert u[:, 0] == pytest.approx(np.linspace(0.0, 1.0, 21))
    assert after.path_error["force"].largest > 0.0


@pytest.mark.parametrize("seed", range(3))
def test_time_of_a_plan_counts_from_now(seed: int, tmp_path: Path) -> None:
    """Until its first row the newest inputs hold; that it begins late is said."""
    twin, rows, path = oven(), recorded(seed), tmp_path / "plan.csv"
    duty, room = list(twin.blocks(rows))[-1].u[-1]
    path.write_text(f"t,heater [1],room [K]\n0,{duty},{room}\n100,0.3,{room}\n200,0.3,{room}\n")
    whole = twin.forecast(60.0, rows, inputs=path)
    path.write_text(f"t,heater [1],room [K]\n100,0.3,{room}\n200,0.3,{room}\n")
    late = twin.forecast(60.0, rows, inputs=path)
    assert late.t == pytest.approx(whole.t) and late.inputs == pytest.approx(whole.inputs)
    assert late.notes == ("plan.csv begins 100 s from now: until then the newest inputs are held",)
    path.write_text("t,heater,room\n5,30,21\n10,30,21\n")
    soon = twin.forecast(60.0, rows, inputs=path)
    assert soon.t[:2] == pytest.approx([5.0, 10.0]) and soon.inputs[0] == pytest.approx(
        [duty, room]
    )
    assert soon.notes == () and soon.horizon == pytest.approx(15.0)
    path.write_text("t,heater,room\n-5,30,21\n10,30,21\n")
    with pytest.raises(DataError, match="t counts from now"):
        twin.forecast(60.0, rows, inputs=path)
