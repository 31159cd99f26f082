"""A kiln that held: its sensor in another unit, turned, silent; or the kiln itself."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from evertwin import RunResult, Twin
from evertwin.fold import Event
from planted.draws import first_of

ROWS, AT = 1700, 1000
TWIN = """
schema = 1
name = "kiln"
beat = "100 s"
[model]
kind = "thermal"
[model.parameters]
heater_power = { value = 900 }
heater_capacity = { value = 200 }
heater_conductance = { value = 200 }
box_capacity = { value = 8000 }
box_conductance = { value = 8 }
[[source]]
name = "log"
time = { column = "t", unit = "s" }
[source.channels]
box = { column = "box", unit = "degC" }
room = { column = "room", unit = "degC" }
heater = { column = "heater", unit = "1" }
[arbiter]
use = "blend"
[prediction]
horizon = "100 s"
[anomaly]
requirement = "0.5 K"
outputs = ["box"]
window = "1000 s"
[tuning]
window = "8000 s"
editable = ["heater_power", "box_capacity", "box_conductance", "heater_start"]
"""


def fired(loss: float = 1.0, power: float | None = None) -> dict[str, np.ndarray]:
    """Five seconds a row, by a thermostat; from AT on it loses so many times as much heat. With a
    ``power``: switched at random, and from AT on with so many times the heat."""
    rng, box, heater, on, point = np.random.default_rng(3), 25.0, 25.0, 0.0, 50.0
    switched = np.repeat(np.random.default_rng(4).integers(0, 2, ROWS // 10), 10).astype(float)
    data = np.empty((ROWS, 4))
    for k in range(ROWS):
        point = rng.uniform(40.0, 80.0) if k % 150 == 0 else point
        on = 1.0 if box < point - 0.6 else 0.0 if box > point + 0.6 else on
        on = on if power is None else switched[k]
        data[k] = 5.0 * k, on, 20.0, box
        g, most = (8.0 * loss, 900.0 * (power or 1.0)) if k >= AT else (8.0, 900.0)
        for _ in range(10):
            heat = 200.0 * (heater - box)
            heater += 0.5 * (most * on - heat) / 200.0
            box += 0.5 * (heat - g * (box - 20.0)) / 8000.0
    data[:, 3] += rng.normal(0.0, 0.05, ROWS)
    return dict(zip(("t", "heater", "room", "box"), data.T, strict=True))


def lived(folder: Path, data: dict[str, np.ndarray]) -> RunResult:
    (folder / "kiln.toml").write_text(TWIN)
    table, head = np.stack(list(data.values()), axis=1), ",".join(data)
    np.savetxt(folder / "log.csv", table, "%.9g", ",", header=head, comments="")
    with Twin.open(folder / "kiln.toml") as twin:
        return twin.run(folder / "log.csv")


@pytest.mark.parametrize(
    ("number", "shift", "said"),
    [(1.8, 32.0, "box looks recorded in degrees Fahrenheit"), (-1.0, 0.0, "the sign of box")],
)
def test_another_unit_is_named_and_not_learned(
    tmp_path: Path, number: float, shift: float, said: str
) -> None:
    data = fired()
    data["box"][AT:] = number * data["box"][AT:] + shift
    result = lived(tmp_path, data)
    told = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert told and said in told[0].reason and "row 1" in told[0].reason
    assert not result.of_kind("promoted", "tuned")


@first_of(("number", "shift"), [(1.0, 8.0), (1.4, 16.0)])
def test_what_leaps_as_no_number_of_the_machine_makes_it_is_not_learned(
    tmp_path: Path, number: float, shift: float
) -> None:
    """Off by a constant; or one of two sensors, of which the mean is known, in °F since then."""
    data = fired()
    data["box"][AT:] = number * data["box"][AT:] + shift
    result = lived(tmp_path, data)
    told = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    assert told and "box looks off by +" in told[0].reason and "from row 1000 on" in told[0].reason
    assert not result.of_kind("promoted", "tuned") and "nothing is learned" in result.headline


def test_a_leap_is_waited_for_until_enough_rows_tell_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is asked about some 60 rows later, too few to be learned on and judged by."""
    twin = TWIN.replace("1000 s", "200 s").replace('horizon = "100 s"', 'horizon = "50 s"')
    twin = twin.replace('"heater_power", ', "").replace(', "heater_start"', "")
    monkeypatch.setattr(sys.modules[__name__], "TWIN", twin)
    data = fired()
    data["box"][AT + 15 :] += 30.0
    result = lived(tmp_path, data)
    assert "box looks off by +" in result.headline and not result.of_kind("promoted", "tuned")


def test_exchanged_temperatures_are_named_though_a_hidden_one_goes_wrong_by_it(
    tmp_path: Path,
) -> None:
    data = fired()
    data["room"] += np.random.default_rng(6).normal(0.0, 0.05, ROWS)
    data["box"][AT:], data["room"][AT:] = data["room"][AT:].copy(), data["box"][AT:].copy()
    result = lived(tmp_path, {name: column[: AT + 400] for name, column in data.items()})
    assert "room and box look exchanged" in result.headline
    assert not result.of_kind("promoted", "tuned")


PAIR = """first = { column = "first", unit = "degC" }
second = { column = "second", unit = "degC" }
"""
MEAN = """[[derive]]
name = "box"
op = "mean"
from = ["first", "second"]
unit = "K"
"""


@first_of("seed", [1, 2, 3])
@pytest.mark.parametrize("fault", ["degF", "room"])
def test_one_of_two_averaged_sensors_is_named(
    tmp_path: Path, fault: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    head, rest = TWIN.split('box = { column = "box", unit = "degC" }\n')
    monkeypatch.setattr(
        sys.modules[__name__], "TWIN", head + PAIR + rest.replace("[arbiter]", f"{MEAN}[arbiter]")
    )
    data, rng = fired(), np.random.default_rng(seed)
    box = data.pop("box")
    data |= {name: box + rng.normal(0.0, 0.05, ROWS) for name in ("first", "second")}
    data["room"] += np.sin(np.arange(ROWS) / 200.0) + rng.normal(0.0, 0.05, ROWS)
    if fault == "degF":
        data["first"][AT:] = 1.8 * data["first"][AT:] + 32.0
        said = "one of first and second, of which box is the mean, looks recorded in degrees Fahr"
    else:
        data["first"][AT:], data["room"][AT:] = data["room"][AT:].copy(), data["first"][AT:].copy()
        said = "room and one of first and second, of which box is the mean, look exchanged"
    result = lived(tmp_path, data)
    assert said in result.headline and not result.of_kind("promoted", "tuned")


def test_a_sensor_that_only_dithers_is_not_learned(tmp_path: Path) -> None:
    data = fired()
    dither = np.random.default_rng(5).normal(0.0, 0.01, ROWS - AT)
    data["box"][AT:] = data["box"][AT] + dither
    result = lived(tmp_path, data)
    told = [e for e in result.events if "frozen" in e.reason or "no longer answers" in e.reason]
    assert told and not result.of_kind("promoted", "tuned")


def test_a_kiln_that_loses_more_heat_is_tuned(tmp_path: Path) -> None:
    result = lived(tmp_path, fired(loss=1.5))
    assert result.of_kind("promoted")
    assert not [e for e in result.of_kind("abnormal") if "number" in e.evidence]


@pytest.mark.long
def test_a_command_that_has_its_usual_levels_is_in_no_other_unit(tmp_path: Path) -> None:
    result = lived(tmp_path, fired(power=0.28))
    assert result.of_kind("tuned")
    assert not [e for e in result.of_kind("abnormal") if "heater looks" in e.reason]


def chamber() -> dict[str, np.ndarray]:
    """A box with a heater and a hidden wall, 2,400 rows of 5 s."""
    rng, heat, box, wall = np.random.default_rng(3), 22.0, 22.0, 22.0
    on = np.repeat(rng.uniform(0.0, 1.0, 40), 60)
    room, data = 21.0 + 1.5 * np.sin(np.arange(2400) / 300.0), np.empty((2400, 4))
    for k in range(2400):
        data[k] = 5.0 * k, on[k], room[k], box
        for _ in range(10):
            q, w = 3.1 * (heat - box), 2.4 * (box - wall)
            heat += 0.5 * (240.0 * on[k] - q) / 180.0
            box += 0.5 * (q - 1.6 * (box - room[k]) - w) / 900.0
            wall += 0.5 * w / 9000.0
    data[:, 3] += rng.normal(0.0, 0.05, 2400)
    return dict(zip(("t", "heater", "room", "box"), data.T, strict=True))


CHAMBER = {
    "heater_power": 240.0, "heater_capacity": 180.0, "heater_conductance": 3.1,
    "box_capacity": 900.0, "box_conductance": 1.6, "wall_capacity": 9000.0,
    "wall_conductance": 2.4,
}  # fmt: skip


def doubted(
    tmp_path: Path, number: float, shift: float, monkeypatch: pytest.MonkeyPatch
) -> tuple[RunResult, list[Event]]:
    """A walled chamber whose room sensor is ``number`` times what it is, and ``shift``, from row
    900 on, of which no row from before is kept; what was said of a channel within 400 rows."""
    head, rest = TWIN.split("[model.parameters]")[0], TWIN[TWIN.index("[[source]]") :]
    numbers = "".join(f"{name} = {{ value = {value} }}\n" for name, value in CHAMBER.items())
    head = head.replace('"thermal"', '"thermal"\noptions = { wall = true }')
    rest = rest[: rest.index("editable")].replace("8000 s", "3000 s")
    free = [*list(CHAMBER)[2:], "heater_start", "wall_start"]
    twin = f"{head}[model.parameters]\n{numbers}{rest}editable = {free}\n".replace("'", '"')
    monkeypatch.setattr(sys.modules[__name__], "TWIN", twin)
    data = chamber()
    data["room"][900:] = number * data["room"][900:] + shift
    result = lived(tmp_path, data)
    told = [e for e in result.of_kind("abnormal") if "number" in e.evidence]
    return result, [e for e in told if e.row < 1300]


def test_an_input_is_doubted_even_when_no_row_from_before_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is hidden is known from before alone: afterwards the rows fit a machine that changed."""
    said = "room looks recorded in degrees Fahrenheit"
    result, told = doubted(tmp_path, 1.8, 32.0, monkeypatch)
    assert told and said in told[0].reason
    assert not result.of_kind("promoted") and said in result.headline


def off_by(folder: Path, shift: float, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Is the chamber's offset room named, and nothing learned of it?"""
    result, told = doubted(folder, 1.0, shift, monkeypatch)
    said = f"room looks off by {'+' if shift > 0.0 else '-'}"
    return bool(told and said in told[0].reason and not result.of_kind("promoted"))


@pytest.mark.long
def test_an_offset_of_an_input_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert off_by(tmp_path, -6.0, monkeypatch)


@pytest.mark.long
def test_an_offset_of_an_input_is_told_from_a_machine_that_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In five of seven: 120 rows after it numbers of the machine may do nearly as well."""
    known = sys.modules[__name__].__dict__["TWIN"]
    found = 0
    for shift in (4.0, 5.0, 6.0, 7.0, 8.0, -6.0, -8.0):
        monkeypatch.setattr(sys.modules[__name__], "TWIN", known)
        (folder := tmp_path / str(shift)).mkdir()
        found += off_by(folder, shift, monkeypatch)
    assert found >= 5
