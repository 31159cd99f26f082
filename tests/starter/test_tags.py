"""Tags of process machines: what drives and what answers where they say it; else it is asked."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.starter.channels.cause import told
from evertwin.starter.looks.words import role, said_unit, words

T = np.arange(600.0)
TOLD = {
    "Time,TIC-12.PV [degC],TIC-12.OUT [%]": "u=TIC-12.OUT y=TIC-12.PV",
    "Zeit;LIC204.PV [m];LIC204.MV [%];QT-3 [m3/h]": "u=LIC204.MV y=LIC204.PV",
    "Zeit;Ofen1.X [°C];Ofen1.Y [%]": "u=Ofen1.Y y=Ofen1.X",
    "ts,Ofen2.W [°C],Ofen2.X [°C],other": "u=? y=?",
    "time,MILL_SPD_SP (rpm),MILL_SPD (rpm),MILL_PWR (kW)": "u=MILL_SPD_SP y=MILL_SPD",
    "t,Cyl.PosCmd_mm,Cyl.PosAct_mm,Cyl.Pressure_bar": "u=Cyl.PosCmd_mm y=Cyl.PosAct_mm",
    "stamp,feed_tph,mill_power_kW,mill_speed_rpm": "u=? y=?",
    "t,BELT.ST_SPEED m/s,BELT.WIT t/h,BELT.JI kW": "u=? y=?",
    "time,JT-7 kW,WT-7 t/h,ST-7 rpm": "u=? y=?",
    "time,G1_ActPower kW,G1_Vib mm/s,G1_OilTemp °C,G1_AmbientTemp °C": "u=? y=G1_OilTemp °C",
    "time,G1_ActPower kW,G1_OilTemp °C,G1_AmbientTemp °C,G1_TORQUE Nm": "u=? y=G1_OilTemp °C",
    "time,Chiller_Pwr [kW],CHW_Flow [m3/h],CHW_Supply [degC],CHW_Return [degC]": "u=? y=?",
    "time,COMP_LOAD_%,N2_FLOW Nm3/h,TANK_P bar": "u=? y=?",
    "time,GEN_EXC_CMD,GEN_VOLT_kV,GEN_MVAR": "u=GEN_EXC_CMD y=?",
    "time,dosing_pump_OP,pH,cond": "u=dosing_pump_OP y=?",
    "t,VSD4.speed m/s,LIFT.LOAD kg,VSD4.TORQUE_REF":
        "lift_load=LIFT.LOAD kg vsd4_torque_ref=VSD4.TORQUE_REF vsd4_speed=VSD4.speed m/s",
    "time,FV-33.ZT [%],FT-33 [m3/h],TT-33 [°C]": "u=FV-33.ZT y=TT-33",
    "time,FV-33.ZT [%],PCV-34.ZT [%],TT-33 [°C]": "u=? y=TT-33",
    "time,AHU_FAN_%,AHU_DP Pa,AHU_SAT °C": "u=AHU_FAN_% y=AHU_SAT °C",
    "ts,SIC-9.OUT [%],FIC-9.PV [m³/h],PT-9.PV [bar]":
        "speed=SIC-9.OUT flow=FIC-9.PV pressure=PT-9.PV",
    "ts,PUMP_SPD_%,PUMP_FLOW m3/h,PUMP_PRESS bar,SUCTION °C":
        "speed=PUMP_SPD_% flow=PUMP_FLOW m3/h pressure=PUMP_PRESS bar",
    "time,u1,u2,y1,y2": "u1=u1 u2=u2 y1=y1 y2=y2",
}  # fmt: skip


def recorded(folder: Path, name: str, heading: str) -> Path:
    rng, separator = np.random.default_rng(1), ";" if ";" in heading else ","
    set_by_hand = re.compile(r"%|OP|OUT|MV|CMD|Cmd|SP\b|REF|\.W")
    values = [
        50 + 40 * np.sign(np.sin(T / 25 + k)) if set_by_hand.search(one)
        else 20 + 5 * np.sin(T / (30 + 7 * k)) + rng.normal(0, 0.1, len(T))
        for k, one in enumerate(heading.split(separator)[1:])
    ]  # fmt: skip
    rows = np.stack([T, *values], axis=1)
    lines = [separator.join(f"{x:.3f}" for x in row) for row in rows]
    path = folder / name
    path.write_text("\n".join([heading, *lines, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize(("heading", "means"), TOLD.items())
def test_a_role_is_told_by_its_tag_or_asked(
    heading: str, means: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new.toml"
    file = recorded(tmp_path, "run.csv", heading)
    write_starter([file], out, ("", None), force=False, as_json=False)
    capsys.readouterr()
    text = out.read_text(encoding="utf-8")
    assert 'kind = "python"' in text
    found = re.findall(r'^(\w+) = \{ column = "(.*?)"', text, re.MULTILINE)
    told = " ".join(f"{name}={column}" for name, column in found if name != "time")
    assert told == means


def test_a_question_names_the_columns_that_could_be_meant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = recorded(tmp_path, "run.csv", "time,FAN_SPD_SP (rpm),FAN_SPD (rpm),FAN_PWR (kW)")
    write_starter([file], tmp_path / "new.toml", ("", None), force=False, as_json=False)
    assert "which one answers? FAN_SPD; FAN_PWR" in capsys.readouterr().out


def test_another_recording_of_the_same_time_is_a_second_source(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main = recorded(tmp_path, "dcs.csv", "time,FAN_%,TI_HOT [°C],FT [m3/h]")
    other = recorded(tmp_path, "weather.csv", "time,WX.WB [°C]")
    out = tmp_path / "new.toml"
    write_starter([main, other], out, ("", None), force=False, as_json=False)
    capsys.readouterr()
    text = out.read_text(encoding="utf-8")
    assert text.count("[[source]]") == 2
    assert 'wx_wb = { column = "WX.WB", unit = "°C" }' in text


def test_units_behind_a_blank_and_shares_are_read() -> None:
    said = {"FI Nm3/min": "m^3/min", "PI_RCV bar": "bar", "LOAD kg": "kg", "VFD_%": "%",
            "belt speed m/s": "m/s", "WIT t/h": "t/h", "P el kW": "kW"}  # fmt: skip
    assert {name: said_unit(name) for name in said} == said
    none = ("Temp in", "flow set", "speed min", "Vib max", "axis A", "bar", "kg", "Zone 1")
    assert {name: said_unit(name) for name in none} == dict.fromkeys(none, "")


def test_active_power_is_no_actual_value_and_a_thermocouples_outlet_no_command() -> None:
    assert role(words("G1_ActPower")) == "" and role(words("G1_ActSpeed")) == "measured"
    assert told("TC1_out", "degC") == -1 and told("TIC1.OUT", "%") == 2
    assert told("A.Y", "m", {"A.X": "m", "A.Y": "m"}) == 0  # a place in the plane
