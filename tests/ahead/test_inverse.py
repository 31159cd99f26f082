"""What to set for a wanted speed: the map, its inverse, what cannot be had; by the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.inverse import crossing, inverse
from evertwin.app.cli import main
from evertwin.errors import UsageError
from evertwin.models.spec import ModelSpec
from planted.twins import TWINS

U = np.linspace(-0.2, 0.2, 81)


def dead(u: float) -> float:
    """A dead zone to 0.06, a cap at 0.16."""
    return 0.0 if abs(u) <= 0.06 else float(np.clip(0.97 * u, -0.16, 0.16))


def test_the_set_point_nearest_to_zero_is_told() -> None:
    rates = np.array([dead(float(u)) for u in U])
    assert crossing(dead, U, rates, 0.1) == pytest.approx(0.1 / 0.97, abs=1e-6)
    assert crossing(dead, U, rates, -0.1) == pytest.approx(-0.1 / 0.97, abs=1e-6)
    assert crossing(dead, U, rates, 0.0) == 0.0
    assert crossing(dead, U, rates, 0.03) is None and crossing(dead, U, rates, 0.2) is None
    cap = crossing(dead, U, rates, 0.16)
    assert cap is not None and 0.164 < cap < 0.171


def recording(folder: Path) -> Path:
    """A cart that follows a sweep over all speeds."""
    v = np.repeat(np.r_[0.0, np.arange(1.0, 21.0)], 3)
    x = np.r_[0.0, np.cumsum(v[:-1])] + np.random.default_rng(0).normal(0, 0.2, len(v))
    lines = ["t,v_cmd,x", *(f"{k},{a},{b:.3f}" for k, (a, b) in enumerate(zip(v, x)))]
    (folder / "run.csv").write_text("\n".join([*lines, ""]))
    return folder / "run.csv"


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ["setpoint", str(TWINS / "robot1d.toml"), "--data", str(recording(tmp_path))]
    more = ["--wanted", "10 cm/s", "--wanted", "0.5 m/s"]
    with pytest.raises(SystemExit) as ended:
        main([*call, *more, "--json"])
    assert ended.value.code == 0
    found, beyond = json.loads(capsys.readouterr().out)["answers"]
    assert found["set_point"] == pytest.approx(0.1) and found["gives95"][0] < 0.1
    assert beyond["set_point"] is None and beyond["nearest"] == [pytest.approx(0.2), None]
    assert beyond["outside"] and beyond["model_alone"] is None
    with pytest.raises(SystemExit):
        main([*call, *more])
    text = capsys.readouterr().out
    assert "set v = 10 cm/s" in text
    assert "50 cm/s: not known, beyond what recorded v gives, of which the nearest is 20" in text
    for wrong in (
        [],
        ["--wanted", "3"],
        ["--wanted", "10 cm/s", "--wanted", "3"],
        ["--wanted", "3 rad/s"],
        ["--wanted", "fast"],
    ):
        with pytest.raises(SystemExit) as ended:
            main([*call, *wrong])
        assert ended.value.code == 2
    capsys.readouterr()


def test_an_output_that_measures_something_else_is_refused(tmp_path: Path) -> None:
    file = str(recording(tmp_path))
    with Twin.open(TWINS / "robot1d.toml") as twin, pytest.raises(UsageError, match="--output"):
        inverse(twin.prospect(None, file).basis, [1.0], "K", ("v", ""), file)


def heated(seed: int, rows: int = 4320, dt: float = 60.0) -> tuple[Twin, dict[str, np.ndarray]]:
    """A box that is heated over days, in a room of 20 to 22 degC."""
    rng = np.random.default_rng(seed)
    twin = Twin(TwinSpec("oven", ModelSpec("thermal")))
    u = np.stack([np.repeat(rng.uniform(0.0, 0.8, rows // 120), 120),
                  294.15 + np.sin(np.arange(rows) / 200.0)], axis=1)  # fmt: skip
    p = twin.model.parameters.values
    _, y = twin.model.simulate(twin.model.initial(p), u, np.full(rows, dt), p)
    box = y[:, 0] + rng.normal(0.0, 0.1, rows)
    return twin, {"t": dt * np.arange(rows), "heater": u[:, 0], "room": u[:, 1], "box": box}


@pytest.mark.parametrize("seed", range(3))
def test_a_temperature_settles_in_the_room_that_was_recorded(seed: int) -> None:
    twin, rows = heated(seed)
    basis = twin.prospect().basis
    found = inverse(basis, [323.15], "K", ("", ""), rows)
    (one,) = found.answers
    assert found.channels == ("heater", "box"), "the room is in kelvin too"
    assert one.set_point is not None and found.direct and "room at 294" in found.note
    p, held = twin.model.parameters.values, np.tile([one.set_point, 294.15], (5000, 1))
    _, y = twin.model.simulate(twin.model.initial(p), held, np.full(5000, 60.0), p)
    assert y[-1, 0] == pytest.approx(323.15, abs=0.5)


def test_what_still_drifts_has_no_map() -> None:
    """Over ten minutes the box has not moved by a hundredth of its temperature in kelvin."""
    twin, rows = heated(0)
    rows["t"] = 0.001 * np.arange(len(rows["t"]))
    with pytest.raises(UsageError, match=r"does not settle within 43\.2 s"):
        inverse(twin.prospect().basis, [323.15], "K", ("heater", "box"), rows)


@pytest.mark.parametrize("dt", [0.1, 0.4, 1.6])
def test_how_often_a_machine_is_measured_does_not_tell_whether_it_settles(dt: float) -> None:
    """A few thousand rows are minutes or hours; the box settles in an hour."""
    twin, rows = heated(1, 24000, dt)
    (one,) = inverse(twin.prospect().basis, [323.15], "K", ("", ""), rows).answers
    assert one.set_point == pytest.approx(0.169, abs=0.002)


def test_two_inputs_that_move_it_alike_are_asked_for() -> None:
    twin, rows = heated(2)
    rows["room"] = 294.15 + 40.0 * np.sin(np.arange(len(rows["t"])) / 200.0)
    with pytest.raises(UsageError, match=r"moves alike by heater, room .* --input"):
        inverse(twin.prospect().basis, [323.15], "K", ("", ""), rows)
