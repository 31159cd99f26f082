"""Twin files: what is read, and what is said about those that are wrong."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evertwin.config import TwinSpec, files_of, read, reads
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.settings.quantity import number
from evertwin.signals.units import from_si

HEAD = 'schema = 1\nname = "axis"\nmodel = { kind = "drive" }\n'


@pytest.fixture(scope="module")
def full(full_text: str) -> TwinSpec:
    return reads(full_text)


def test_quantities_are_read_into_si(full: TwinSpec) -> None:
    assert full.model.options == {"base": 0.3, "label": "r2", "gears": (1, 2)}
    gain = full.model.parameters["gain"]
    assert (gain.value, gain.low, gain.sigma) == (1.0, 0.5, 0.1)
    assert full.clock.rate == 1000.0
    assert full.clock.gap == 60.0
    assert full.clock.crop is not None
    assert full.clock.crop.above == 0.02
    assert full.signals["heading"].high == math.pi


def test_a_value_may_stand_for_its_section(full: TwinSpec) -> None:
    assert full.model.parameters["slip"].value == 0.1
    assert full.source[0].time.column == "t"
    assert full.signals["v"].source == "v_cmd"


def test_groups_say_only_what_differs(full: TwinSpec) -> None:
    group = full.arbiter.groups["heading"]
    assert (group.gate, group.vote) == (3.0, 8)
    assert group.tolerance == pytest.approx(math.pi / 180)
    assert full.arbiter.tolerance == 0.02


def test_mixed_lists_and_mappings_are_kept(full: TwinSpec) -> None:
    assert full.source[0].channels["v"].sentinels == (-1.0, 9.5)
    assert full.source[1].where == {"mode": (1.0, 2.0)}
    assert full.tuning.causes == {"load": ("mass",)}
    assert full.tuning.weights == {"gain": 2.0}


@pytest.mark.parametrize(
    ("text", "relative"),
    [("0.05", True), ("'2 cm'", False), ("'5 %'", True), ("'6 deg'", False), ("'0.1 rad'", False)],
)
def test_a_requirement_with_a_unit_is_absolute(text: str, relative: bool) -> None:
    assert reads(f"{HEAD}[anomaly]\nrequirement = {text}").anomaly.relative is relative


def test_an_absolute_requirement_cannot_be_called_relative() -> None:
    with pytest.raises(ConfigError, match=r"f:4: anomaly: requirement '2 cm' has a unit"):
        reads(f"{HEAD}[anomaly]\nrequirement = '2 cm'\nrelative = true", "f")


def test_a_spread_of_temperatures_has_no_offset() -> None:
    text = "[model.parameters.room]\nvalue = 20\nsigma = 0.5\nunit = 'degC'"
    room = reads(HEAD.replace('model = { kind = "drive" }', '[model]\nkind = "box"') + text)
    parameter = room.model.parameters["room"]
    assert (parameter.value, parameter.sigma) == (293.15, 0.5)


WRONG = {
    "nearest key": ("[clock]\nrat = 5", "f:5: [clock] unknown key 'rat', did you mean 'rate'?"),
    "no near key": ("[store]\nxyz = 5", "f:5: [store] unknown key 'xyz', there are path"),
    "deep key": (
        "[[source]]\nname = 'a'\n[source.channels.v]\ncolumn = 1\nunit = 'm'\nscal = 2",
        "f:9: [source[0].channels.v] unknown key 'scal', did you mean 'scale'?",
    ),
    "missing key": ("[moving]", "f:4: [moving] needs 'above': Moving where"),
    "type": (
        "beat = true",
        "f:4: beat: expected 1 to 1000000 rows or a time such as '30 s', got true",
    ),
    "fraction": ("beat = 1.5", "f:4: beat: expected 1 to 1000000 rows or a time"),
    "range": ("beat = 0", "f:4: beat: expected 1 to 1000000 rows or a time such as '30 s', got 0"),
    "not a number": (
        "[trial]\nalpha = nan",
        "f:5: trial.alpha: expected a number, got nan",
    ),
    "no unit taken": ("[trial]\nalpha = '1 m'", "f:5: trial.alpha: expected a number, got '1 m'"),
    "unit": ("[clock]\nrate = '5 s'", "f:5: clock.rate: expected a quantity in 'Hz' or alike, got"),
    "unknown unit": ("[clock]\nrate = '5 zork'", "f:5: clock.rate: unit: 'zork' is not known"),
    "text for a number": (
        "[clock]\nrate = 'fast'",
        "f:5: clock.rate: expected a number or text such as '2 cm', got 'fast'",
    ),
    "word": (
        "[tuning]\nmethod = 'recursiv'",
        "f:5: tuning.method: expected one of 'auto', 'recursive', 'iteration', got 'recursiv', "
        "did you mean 'recursive'?",
    ),
    "array": ("[tuning]\nladder = 'sign'", "f:5: tuning.ladder: expected an array such as"),
    "table": ("clock = 5", "f:4: clock: expected a table, got 5"),
    "table of tables": ("[tuning]\nweights = 5", "f:5: tuning.weights: expected a table, got 5"),
    "switch": ("[correction]\nrefine = 'yes'", "f:5: correction.refine: expected true or false"),
    "text": ("[store]\npath = 5", "f:5: store.path: expected text, got 5"),
    "either": (
        "[[source]]\nname = 'a'\nchannels = {}\ntask = 1.5",
        "f:7: source[0].task: expected text or a whole number, got 1.5",
    ),
    "both ends": ("[clock]\nstart = 5\nstop = 2", "f:4: clock: expected start < stop, got 5 s"),
    "secret": ("[store]\npath = '${ABSENT_NAME}'", "f:5: store.path: the environment variable ABS"),
    "channel's unit": (
        "[[source]]\nname = 'a'\n[source.channels]\nv = { column = 0, unit = 'zork' }",
        "f:7: source[0].channels.v: unit: 'zork' is not known",
    ),
    "erased": (
        "[[source]]\nname = 'a'\n[source.channels]\nv = { column = 0, unit = 'm', scale = 0 }",
        "f:7: source[0].channels.v: scale: expected a factor other than 0",
    ),
    "time": ("[[source]]\nname = 'a'\nchannels = {}\ntime = {}", "f:7: source[0].time: expected e"),
    "limits": ("[signals.v]\nlow = 2\nhigh = 1", "f:4: signals.v: expected low < high"),
    "newer": ("", "f: has schema 2, this evertwin reads up to 1: upgrade evertwin"),
    "no version": ("", "f:1: needs 'schema = 1'"),
    "not TOML": ("[clock\nrate = 5", "f:4: not TOML: "),
}


@pytest.mark.parametrize("case", WRONG)
def test_the_message_says_where_and_what_to_do(case: str) -> None:
    text, message = WRONG[case]
    head = HEAD
    if case == "newer":
        head = HEAD.replace("schema = 1", "schema = 2")
    elif case == "no version":
        head = HEAD.replace("schema = 1\n", "")
    with pytest.raises(ConfigError) as error:
        reads(head + text, "f")
    assert str(error.value).startswith(message), str(error.value)
    assert error.value.exit_code == 2


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as error:
        reads(f"{HEAD}[clock]\nrat = 1\ngap = -1\n[trial]\nalpha = 2", "f")
    places = [line.split(":")[1] for line in str(error.value).splitlines()]
    assert places == ["5", "6", "8"]


def test_built_without_a_file_the_same_limits_hold() -> None:
    with pytest.raises(UsageError, match=r"gate: expected a number above 0, got -1"):
        type(reads(HEAD).arbiter)(gate=-1.0)


def test_a_recording_given_by_mistake_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_bytes(b"1.0," * 300_000)
    with pytest.raises(ConfigError, match="expected a twin file, not a recording"):
        read(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="expected UTF-8 text, byte 0"):
        read(path)
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file"):
        read(tmp_path / "none.toml")


def sourced(tmp_path: Path) -> TwinSpec:
    """Two sources; ``a1.csv`` to ``a3.csv`` and ``p.csv`` exist."""
    for name in ("a1", "a2", "a3", "p"):
        (tmp_path / f"{name}.csv").write_text("t,x\n")
    path = tmp_path / "twin.toml"
    path.write_text(
        "\ufeff" + HEAD + "[[source]]\nname = 'a'\nchannels = {}\nmatch = 'a*'\n"
        "files = ['a?.csv']\n[[source]]\nname = 'p'\nchannels = {}\nfiles = ['${PLACE}/p.csv']\n",
        encoding="utf-8",
    )
    return read(path)


def test_files_are_found_beside_the_twin_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    twin = sourced(tmp_path)
    with pytest.raises(ConfigError, match=r"source\[1\]\.files: the environment variable PLACE"):
        files_of(twin)
    monkeypatch.setenv("PLACE", ".")
    found = files_of(twin)
    assert [[path.name for path in found[i]] for i in (0, 1)] == [
        ["a1.csv", "a2.csv", "a3.csv"],
        ["p.csv"],
    ]
    monkeypatch.setenv("PLACE", "elsewhere")
    with pytest.raises(DataError, match=r"no such file: correct .*source\[1\]"):
        files_of(twin)


def test_given_files_go_to_the_source_they_match(tmp_path: Path) -> None:
    twin = sourced(tmp_path)
    found = files_of(twin, [tmp_path / "p.csv", tmp_path / "a2.csv"])
    assert [[path.name for path in found[i]] for i in (0, 1)] == [["a2.csv"], ["p.csv"]]
    with pytest.raises(DataError, match=r"none\.csv: no such file"):
        files_of(twin, [tmp_path / "none.csv"])


def test_a_bag_belongs_to_every_source_of_its_topics(tmp_path: Path) -> None:
    source = "[[source]]\nname = '{}'\nchannels = {{ {} = {{ column = '{}', unit = 'm' }} }}\n"
    twin = reads(
        'schema = 1\nname = "base"\n[model]\nkind = "robot1d"\n'
        + source.format("command", "v", "/cmd_vel.linear.x")
        + source.format("camera", "y", "y").replace("channels", "match = '*.csv'\nchannels")
        + source.format("pose", "x", "/odom.pose.pose.position.x")
    )
    for name in ("run.bag", "run.csv"):
        (tmp_path / name).touch()
    found = files_of(twin, [tmp_path / "run.bag"])
    assert [len(found[i]) for i in range(3)] == [1, 0, 1]
    table = dataclasses.replace(twin, source=twin.source[1:])
    assert [len(paths) for paths in files_of(table, [tmp_path / "run.csv"]).values()] == [1, 0]


UNITS = ("m", "cm", "deg/s", "Nm", "degC", "ms", "%")


@given(st.floats(-1e6, 1e6), st.sampled_from(UNITS))
def test_a_quantity_and_back_is_the_same(value: float, unit: str) -> None:
    assert from_si(number(f"{value!r} {unit}"), unit) == pytest.approx(value, rel=1e-12, abs=1e-12)


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        reads(text)
    except ConfigError:
        return


def test_a_slope_without_a_rate_is_refused_where_it_is_written() -> None:
    text = HEAD + '[[derive]]\nname = "a"\nop = "slope"\nfrom = ["v"]\nvalue = 0.3\n'
    with pytest.raises(ConfigError, match=r":6: derive a: a slope is of rows at a fixed rate"):
        reads(text)
    assert reads(text + '[clock]\nrate = "10 Hz"\n').derive[0].op == "slope"
