"""Which machine a recording is of: headings of many makers, made-up numbers; doubt is asked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.starter.looks.words import said_unit
from planted.draws import first_of

T = np.arange(600.0)
RNG = np.random.default_rng(3)

BASES = {
    "time,usage_h,yoke_temp_C,burner_pct": "python ?",
    "t,odom_v_m_s,odom_w_rad_s,x_m,y_m,yaw_rad": "differential v=odom_v_m_s w=odom_w_rad_s x=x_m",
    "stamp;odometry.vx [m/s];odometry.wz [rad/s];gps_x_m;gps_y_m;gps_yaw_rad":
        "differential v=odometry.vx w=odometry.wz x=gps_x_m heading=gps_yaw_rad",
    "time,odom_x_m,odom_y_m,odom_yaw_rad,odom_v_m_s,odom_w_rad_s": "python ?",
    "time,enc_left_rad_s,enc_right_rad_s,x_m,y_m,yaw_rad": "python ?",
}  # fmt: skip
HEATED = {
    "time_s,T_bath,T_ambient,heater_W": "thermal box=T_bath room=T_ambient heater=heater_W ?",
    "ts,tank_temp_degC,room_temp_degC,heater_duty_pct":
        "thermal box=tank_temp_degC room=room_temp_degC heater=heater_duty_pct",
    "Zeit [s];Ofentemperatur_C;Raumtemperatur_C;Heizleistung_pct":
        "thermal box=Ofentemperatur_C room=Raumtemperatur_C heater=Heizleistung_pct",
    "Zeit;Umgebungstemperatur [degC];Badtemperatur [degC];Heizung [%]":
        "thermal box=Badtemperatur room=Umgebungstemperatur heater=Heizung",
    "t,T_set_C,T_room_F,T_vessel_F,heating_kW":
        "thermal box=T_vessel_F room=T_room_F heater=heating_kW ?",
    "t,heater,outdoor_degC,room_degC": "thermal box=room_degC room=outdoor_degC heater=heater",
    "t,T_outside_C,room_temp_C,heater_pct":
        "thermal box=room_temp_C room=T_outside_C heater=heater_pct",
    "t,T_top_C,T_bottom_C,T_amb_C,heater_pct": "thermal box=? room=T_amb_C heater=heater_pct ?",
}  # fmt: skip
DRIVEN = {
    "t_s,drive_current_mA,conveyor_speed_m_min": "drive_force force=drive_current_mA ?",
    "t_ms,position_mm,speed_mm_s,force_kN":
        "drive_force position=position_mm speed=speed_mm_s force=force_kN",
    "Zeit [s];Istposition_mm;Sollposition_mm;Motorstrom_A":
        "drive_force position=Istposition_mm force=Motorstrom_A ?",
    "Zeit [s];Position [mm];Geschwindigkeit [mm/s];Strom [A];Kraft [N]":
        "drive_force position=Position speed=Geschwindigkeit force=Kraft",
    "time,spindle_speed_rpm,spindle_torque_Nm": "drive_force speed=spindle_speed_rpm",
    "time,carriage_distance_mm,push_force_N":
        "drive_force position=carriage_distance_mm force=push_force_N",
}  # fmt: skip
WAYS = {
    "time_s,cmd_speed_mm_s,carriage_pos_mm": "robot1d v=cmd_speed_mm_s x=carriage_pos_mm",
    "t;Sollgeschwindigkeit [m/s];Istposition [m]": "robot1d v=Sollgeschwindigkeit x=Istposition",
    "t,v_cmd_m_s,oil_temp_degC,hook_height_m": "robot1d v=v_cmd_m_s x=hook_height_m",
    "t,v_cmd_m_s,push_torque_Nm,lift_force_N,hook_height_m": "python",
    "time_s,speed_mm_s,carriage_pos_mm": "python",
}  # fmt: skip
MOVED = {
    "time,n_rpm,Q_l_min,p_mbar": "python speed=n_rpm flow=Q_l_min pressure=p_mbar",
    "Zeit [s];Drehzahl_U_min;Volumenstrom_m3_h;Foerderdruck_bar":
        "python speed=Drehzahl_U_min flow=Volumenstrom_m3_h pressure=Foerderdruck_bar",
    "ts,fan_speed_rpm,airflow_m3h,dp_kPa,motor_current_A":
        "python speed=fan_speed_rpm flow=airflow_m3h pressure=dp_kPa",
    "ts,pump_rpm,flow_lpm,suction_bar,discharge_bar": "python ?",
}  # fmt: skip


def made_up(heading: str) -> np.ndarray:
    """Numbers that a machine of that kind could have recorded, none of them a model's."""
    low = heading.lower()
    slow = np.cumsum(RNG.normal(0, 1, len(T))) / 10
    if re.search(r"temp|^t_|ba?th|bad", low):
        quiet = re.search(r"amb|room|raum|umgeb", low)
        return 21 + 0.2 * np.sin(T / 90) if quiet else 45 + 8 * np.sin(T / 60) + 0.1 * slow
    if re.search(r"rpm|drehzahl", low):
        return 1500 + 300 * np.sin(T / 40) + RNG.normal(0, 1, len(T))
    if re.search(r"flow|strom_m3|q_l", low):
        return 20 + 5 * np.cos(T / 33) + RNG.normal(0, 0.1, len(T))
    if re.search(r"pct|%|watt|_w$|kw", low):
        return 50.0 + 40 * np.sign(np.sin(T / 25))
    return np.asarray(0.4 * np.sin(T / (5 + len(low))) + 0.02 * slow)


def proposed(heading: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    names = re.split("[,;]", heading)
    values = [T if k == 0 else made_up(name) for k, name in enumerate(names)]
    rows = np.stack(values, axis=1)
    separator = ";" if ";" in heading else ","
    lines = [separator.join(f"{x:.5f}" for x in row) for row in rows]
    path = folder / "run.csv"
    path.write_text("\n".join([heading, *lines]) + "\n", encoding="utf-8")
    out = folder / "new.toml"
    write_starter([path], out, ("", None), force=False, as_json=False)
    capsys.readouterr()
    return out


def columns(text: str) -> Mapping[str, str]:
    return dict(re.findall(r'^(\w+) = \{ column = "(.*?)"', text, re.MULTILINE))


@pytest.mark.parametrize(
    ("heading", "means"), [*{**BASES, **HEATED, **DRIVEN, **WAYS, **MOVED}.items()]
)
def test_what_a_heading_says_is_proposed_and_what_it_does_not_is_asked(
    heading: str, means: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = proposed(heading, tmp_path, capsys).read_text()
    kind, *wanted = means.split()
    asked = "?" in wanted
    wanted = [one for one in wanted if one != "?"]
    assert f'kind = "{kind}"' in text
    found = columns(text)
    assert {w: found.get(w.split("=")[0]) for w in wanted} == {w: w.split("=")[1] for w in wanted}
    assert ('= "?"' in text) == asked, text


def test_a_box_may_have_walls(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heading = "ts,tank_temp_degC,room_temp_degC,heater_duty_pct"
    spec = read(proposed(heading, tmp_path, capsys))
    assert spec.correction.channels == ("heater", "room", "box")
    assert "state" in spec.correction.terms


def test_a_unit_keeps_its_prefix() -> None:
    said = {"force_kN": "kN", "dp_kPa": "kPa", "heating_kW": "kW", "i_mA": "mA", "ForceN": "N"}
    assert {name: said_unit(name) for name in said} == said


@first_of(
    ("heading", "answers"),
    [
        ("ts,tank_temp_degC,room_temp_degC,heater_duty_pct", {}),
        ("time_s,T_bath,T_ambient,heater_W", {'scale = "?"': "scale = 0.001"}),
        ("t_s,drive_current_mA,conveyor_speed_m_min", {'scale = "?"': "scale = 0.062"}),
        ("time,n_rpm,Q_l_min,p_mbar", {}),
        ("t,odom_v_m_s,odom_w_rad_s,x_m,y_m,yaw_rad", {}),
        (
            "ts,level_1,level_2,other_3",
            {
                'u = { column = "?"': 'u = { column = "level_1"',
                'y = { column = "?"': 'y = { column = "level_2"',
            },
        ),
    ],
)
def test_what_is_written_runs_once_it_is_answered(
    heading: str, answers: Mapping[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = proposed(heading, tmp_path, capsys)
    text = out.read_text()
    for question, answer in answers.items():
        assert question in text
        text = text.replace(question, answer)
    out.write_text(text)
    read(out)
    with Twin.open(out) as twin:
        result = twin.run()
    assert any(np.isfinite(one.rms_after) for one in result.outputs.values()), result.headline


@pytest.mark.parametrize(("leak", "constant"), [(0.0, 0.0), (0.02, 0.0), (0.02, 0.4)])
def test_a_store_that_fills_or_leaks_is_told_by_the_model_that_is_written(
    leak: float, constant: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An integrator, a lag, and a lag about a level that is not zero: a tank, a room, a dose."""
    rng, y, rows = np.random.default_rng(5), 20.0, list[str]()
    flow = np.repeat(rng.uniform(-1.0, 1.0, 60), 20)
    for t, u in enumerate(flow):
        rows.append(f"{t},{u:.4f},{y + rng.normal(0.0, 0.02):.4f}")
        y += 0.3 * u - leak * y + constant
    path, out = tmp_path / "run.csv", tmp_path / "new.toml"
    path.write_text("\n".join(["t,feed_set,content", *rows]) + "\n", encoding="utf-8")
    write_starter([path], out, ("", None), force=False, as_json=False)
    capsys.readouterr()
    with Twin.open(out) as twin:
        found = twin.fit()
    assert found.train[0].rms < 0.05
    told = found.fit.to_dict()["parameters"]["gain"]
    assert told["value"] == pytest.approx(0.3, rel=0.05)


@first_of("seed", range(4))
def test_a_force_that_is_told_in_steps_drives_and_one_that_is_measured_does_not(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(seed)
    mass, speed, place, rows, noise = rng.uniform(0.5, 8.0), 0.0, 0.0, list[str](), list[str]()
    for k, force in enumerate(np.repeat(rng.normal(0.0, 6.0, 80), 25)):
        speed += (force - 2.0 * speed - 0.5 * np.tanh(speed / 0.005)) / mass * 0.02
        place += speed * 0.02
        told = f"{place + rng.normal(0.0, 1e-3):.5f},{speed + rng.normal(0.0, 5e-3):.5f}"
        rows.append(f"{0.02 * k:.2f},{force:.4f},{told}")
        noise.append(f"{0.02 * k:.2f},{force + rng.normal(0.0, 0.05):.4f},{told}")
    for kind, table in (("drive", rows), ("drive_force", noise)):
        path, out = tmp_path / f"{kind}.csv", tmp_path / f"{kind}.toml"
        path.write_text("\n".join(["t [s],force [N],pos [m],vel [m/s]", *table]) + "\n")
        write_starter([path], out, ("", None), force=False, as_json=False)
        capsys.readouterr()
        assert f'kind = "{kind}"' in out.read_text()
    with Twin.open(tmp_path / "drive.toml") as twin:
        numbers = twin.fit().fit.to_dict()["parameters"]
    assert numbers["mass"]["value"] == pytest.approx(mass, rel=0.05)
