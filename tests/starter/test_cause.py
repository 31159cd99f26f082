"""Which column of a machine of one's own is the input, and which one the output."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.machines.catalog import machine
from evertwin.starter import look, mapped
from evertwin.starter.kinds import kind_of


def recorded(path: Path, head: str, seed: int) -> dict[str, str]:
    """The answer to steps stands first, what is set second."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(1.5, 6.3, 20), 25)
    y = np.zeros(len(u))
    for i in range(1, len(u)):
        y[i] = y[i - 1] + 0.05 * (u[i - 1] - y[i - 1])
    y += rng.normal(0, 0.01, len(u))
    rows = [f"{i},{a:.3f},{b:.3f}" for i, (a, b) in enumerate(zip(y, u, strict=True))]
    file = path / "run.csv"
    file.write_text("\n".join([head, *rows, ""]))
    return {m.channel: m.column for m in mapped(None, look([file])[0]).matches}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "head",
    ["Level lower tank (V),Pump (V)", "Füllstand [mm],Ventil [%]", "temperature,setpoint",
     "position,u", "V1,V2", "gap,a"],
)  # fmt: skip
def test_words_tell_the_input_and_where_they_do_not_the_steps(
    tmp_path: Path, head: str, seed: int
) -> None:
    found = recorded(tmp_path, f"t [s],{head}", seed)
    names = [name.split(" [")[0].split(" (")[0] for name in head.split(",")]
    assert found == {"u": names[1], "y": names[0]}


def test_a_current_makes_the_torque_and_not_the_voltage_beside_it(tmp_path: Path) -> None:
    t = np.arange(0.0, 20.0, 0.01)
    rows = [f"{a:.2f};{100 * np.sin(a):.2f};{800 * np.cos(a):.1f};{9 * np.sin(a):.2f}" for a in t]
    file = tmp_path / "run.csv"
    file.write_text("\n".join(["t [s];n_ist [rpm];I [mA];U [V]", *rows, ""]))
    seen = look([file])[0]
    assert kind_of(seen) == "drive_force"
    model = machine("drive_force", {"law": "sign+direction", "rotary": True})
    found = {m.channel: m.column for m in mapped(model, seen).matches}
    assert found["torque"] == "I"


def test_what_flows_in_drives_whatever_answers(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    flow, t = np.repeat(rng.uniform(1.0, 2.0, 10), 30), np.arange(300.0)
    table = np.column_stack([t, np.cumsum(flow), flow, np.sqrt(t)])
    file = tmp_path / "run.csv"
    head = "t [s],level [cm],inflow [l/min],level_lower [cm]"
    np.savetxt(file, table, delimiter=",", header=head, comments="")
    found = {m.channel: m.column for m in mapped(None, look([file])[0]).matches}
    assert found == {"u": "inflow", "y": "?"}
