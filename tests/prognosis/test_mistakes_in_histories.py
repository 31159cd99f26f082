"""Mistakes in histories and scenarios: a note where they are harmless, else refused by line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin
from evertwin.ahead.spec import SCENARIO
from evertwin.config.prognosis import IndicatorSpec
from evertwin.errors import ConfigError, DataError
from evertwin.models import Parameters
from evertwin.prognosis.histories.health import indicator_of
from evertwin.prognosis.histories.history_file import of_table
from evertwin.prognosis.histories.observed_series import Observed, in_unit
from evertwin.prognosis.laws import Life, Limit, NotEnough, predict_life
from evertwin.prognosis.outlook.limits import limit_of
from evertwin.prognosis.outlook.lone_series import Series, life_of_series
from evertwin.signals.units import si_unit
from evertwin.sources.texts.small_table import parse, read_table

WEAR = IndicatorSpec("wear", component="gearbox1", unit="Nm", limit=9.0)
PARTS = ("gearbox1", "motor")
CELL = """schema = 1
name = "cell"
[model]
kind = "robot1d"
[[source]]
name = "log"
time = { column = "t", unit = "s" }
channels.v = { column = "v", unit = "m/s" }
channels.x = { column = "x", unit = "m" }
[[indicator]]
name = "capacity"
component = "cell"
unit = "Ah"
limit = 1.4
direction = "below"
"""


def told(text: str, clock: str = "run", rule: IndicatorSpec = WEAR) -> Observed:
    return of_table(rule, parse(text.splitlines(), "h.csv"), clock, (), PARTS)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("run,wear\n1,2\n2,abc", "h.csv:3: wear: expected a number or a date as in 2027-03-01"),
        ("run,wear\n\n1,2\n2,3 Nm", "h.csv:4: wear: expected a number or a date"),
        ('run,wear\n1,2\n2,"1,500"', "h.csv:3: wear: expected a number or a date as in 2027-03-01, "
         "got '1,500': write 1.500 or 1500"),
        ("run,wear\n1,2024-01-01\n2,3", "h.csv:3: wear: expected numbers or dates alone, got both"),
        ("run,wear\n1,2\n2,inf", "h.csv:3: wear: expected a finite number"),
        ("run,wear\n1", "h.csv:2: expected 2 cells, got 1"),
        ("run,wear,wear\n1,2,3", "h.csv:1: expected a heading of its own for each column, got "
         "'wear' twice"),
        ("", "h.csv: expected a line of headings and rows below it, got an empty file"),
        ("run,wear\n", "h.csv: expected a line of headings and rows below it, got only 'run,wear'"),
        ("run,waer\n1,2", "h.csv: indicator wear: no column 'wear', did you mean 'waer'?: name it"),
        ("run,wear\n1,2\n,3", "h.csv:3: run: expected when the row was, got an empty cell: fill"),
        ("run,wear\nR1,2\n2,3", "h.csv:2: run: expected a number or a date"),
        ("run,wear\n1,2\n2,3\n2,4\n", "h.csv:4: expected one wear for each run, got 4, and 3 for "
         "the same one in row 3: delete one, or write their mean"),
        ("pump,run,wear\nA,1,2\nA,2,3\nB,1,4\nB,2,5\n", "of several machines keep the rows of one "
         "pump"),
        ("run,wear\n0,1\n50,2\n90,3\n0,1\n50,1.5\n80,2", "run starts again in row 5: count on "
         "there beyond 90, with 'replaced' in a column maintenance"),
        ("run,wear\n2,3\n1,2\n2,4\n1,9", "in row 3, and 1 more such rows: delete one"),
        ("run,wear,sigma\n1,2,0.1\n2,3,-0.1", "h.csv:3: sigma: expected a standard deviation above "
         "0, got -0.1: leave the cell empty where it is not known"),
        ("run,wear,wear.sigma\n1,2,0", "h.csv:2: wear.sigma: expected a standard deviation"),
        ("run,wear [degC]\n1,2", "h.csv: wear: expected a unit like Nm, got one like K"),
        ("run,wear [foo]\n1,2", "h.csv:1: wear: unit: 'foo' is not known"),
        ("run,wear,maintenance\n1,2,\n2,3,gearbx1: replaced", "h.csv:3: maintenance: no component "
         "'gearbx1', did you mean 'gearbox1'?"),
        ("run,wear,maintenance\n1,2,oiled", "h.csv:2: maintenance: expected 'replaced' (a new life "
         "begins), 'adjusted' (the level shifts, wear goes on) or 'failed' (life ended here), got "
         "'oiled'?"),
        ("run,wear,maintenance\n1,2,replacd", "got 'replacd', did you mean 'replaced'?"),
        ("run,wear,maintenance\n1,2,not replaced", "got 'not replaced'?"),
        ("run,wear,maintenance\n1,2,1", "h.csv:2: maintenance: expected what was done, as in "),
    ],
)  # fmt: skip
def test_a_bad_history_is_refused_with_its_line(text: str, said: str) -> None:
    with pytest.raises(DataError) as caught:
        told(text)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("date,wear\n01.03.2027,2", "h.csv:2: date: expected a number or a date as in 2027-03-01, "
         "got '01.03.2027', and no row says which of its numbers is the day"),
        ("date,wear\n2027-03-01,2\n,3", "h.csv:3: date: expected when the row was, got an empty"),
        ("date,wear\n2027-03-01,2\n2027-13-01,3", "h.csv:3: date: expected a number or a date"),
        ("date,wear\n2027-03-01T00:00+01:00,2\n2027-03-02,3", "h.csv:3: date: expected a zone with "
         "each date or with none, got '2027-03-02'"),
        ("date,wear\n46082,2", "h.csv:2: date: expected dates as in 2027-03-01, got 46082: write"),
        ("run,wear\n1,2", "h.csv: expected a column 'd', or one of t, time, time_s, date"),
    ],
)  # fmt: skip
def test_dates_that_may_be_read_in_two_ways_are_refused(text: str, said: str) -> None:
    with pytest.raises(DataError) as caught:
        told(text, "d")
    assert said in str(caught.value)


def test_a_table_with_row_numbers_and_dates_with_points_is_read() -> None:
    known = told(",Datetime,wear\n0,2004.02.12.10.32.39,1\n1,2004.02.12.10.42.39,2", "h")
    assert np.diff(known.at) == pytest.approx([1 / 6])
    iso = told("date,wear\n2004-02-12T10:32:39,1\n2004-02-12T10:42:39,2", "h")
    assert known.at.tolist() == iso.at.tolist()
    assert known.value.tolist() == [1.0, 2.0]


def test_what_is_harmless_is_read_with_a_note() -> None:
    turned = told("run,wear\n3,1.3\n1,1.1\n2,1.2")
    assert turned.at.tolist() == [1, 2, 3] and turned.value.tolist() == [1.1, 1.2, 1.3]
    assert turned.notes == ("h.csv: rows were sorted by run: row 3 is earlier than row 2",)
    twice = told("run,wear\n1,1.1\n2,1.2\n2,1.2\n3,1.3")
    assert twice.value.tolist() == [1.1, 1.2, 1.3]
    assert twice.notes == ("h.csv: rows that stand there twice were left out: 4",)
    bare = told("number,wear\n7,1.1\n8,1.2")
    assert bare.at.tolist() == [1, 2] and bare.notes == (
        "h.csv: no column 'run': its 2 rows were counted",
    )
    dated = told("date,wear\n2027-03-02,1.2\n2027-03-01,1.1")
    assert dated.value.tolist() == [1.1, 1.2] and "in the order of date" in dated.notes[0]
    assert told("run,wear\n1,1.1\n2,1.2").notes == ()


def test_other_ways_to_write_the_same_table(tmp_path: Path) -> None:
    plain = told("run,wear\n1,1.5\n2,\n3,2.5")
    for text in (
        "run;wear\n1;1,5\n2;\n3;2,5", "run\twear\n1\t1.5\n2\t\n3\t2.5",
        "# exported\nrun,wear\n1,1.5\n2,n/a\n3,2.5", "run,wear [kNm]\n1,0.0015\n2,nan\n3,0.0025",
    ):  # fmt: skip
        assert np.allclose(told(text).value, plain.value, equal_nan=True), text
    (tmp_path / "bom.csv").write_bytes(b"\xef\xbb\xbfrun,wear\r\n1,1.5\r\n2,\r\n3,2.5\r\n")
    marked = of_table(WEAR, read_table(tmp_path / "bom.csv"), "run")
    assert np.array_equal(marked.value, plain.value, equal_nan=True)
    (tmp_path / "wide.csv").write_bytes("run,wear\n1,2\n".encode("utf-16"))
    with pytest.raises(DataError, match="got UTF-16 text: save it as UTF-8"):
        read_table(tmp_path / "wide.csv")
    with pytest.raises(DataError, match=r"none\.csv: cannot be read"):
        read_table(tmp_path / "none.csv")


def test_maintenance_is_of_whom_the_cell_says() -> None:
    text = (
        "run,wear,maintenance\n1,1,none\n2,2,motor: replaced; gearbox1: adjusted\n3,,new gearbox1"
    )
    assert [(m.at, m.kind) for m in told(text).maintenance] == [
        (2.0, "adjusted"),
        (3.0, "replaced"),
    ]
    all_new = told("run,wear,maintenance\n1,1,replaced")
    assert [m.at for m in all_new.maintenance] == [1.0] and not all_new.notes
    other = told("run,wear,maintenance\n1,1,gearbox2: replaced\n2,1,pump: replaced")
    assert not other.maintenance and other.notes == (
        "h.csv:2: maintenance of 'gearbox2' was left out: indicators tell of gearbox1, motor",
        "h.csv:3: maintenance of 'pump' was left out: indicators tell of gearbox1, motor",
    )
    mentioned = told("run,wear,maintenance\n1,1,motor replaced")
    assert not mentioned.maintenance and not mentioned.notes


def test_of_a_series_alone_any_name_is_its_machine_s_but_that_of_another_column() -> None:
    text = "run,Fc2 [Nm],seal,maintenance\n1,9,1,\n2,1,1,gearbox: replaced\n3,2,1,seal: replaced"
    rule = IndicatorSpec("Fc2", parameter="Fc2", limit=9.0, unit="Nm")
    known = of_table(rule, parse(text.splitlines(), "h.csv"), "run")
    assert [(m.at, m.kind) for m in known.maintenance] == [(2.0, "replaced")] and not known.notes


def test_a_unit_is_that_of_the_indicator() -> None:
    hours = told("run,wear [Ah]\n1,1.8", rule=replace(WEAR, unit="Ah"))
    assert hours.value[0] == pytest.approx(1.8) and hours.unit == "Ah"
    bare = told("run,wear [kNm]\n1,0.002", rule=replace(WEAR, unit=""))
    found = indicator_of(replace(WEAR, unit=""), bare, Limit(9.0), "run", Parameters(()))
    assert found.value[0] == pytest.approx(2.0) and found.unit == si_unit("kNm")


def test_a_limit_in_another_unit_than_si_is_that_of_the_values(tmp_path: Path) -> None:
    """1.4 Ah end the life of a capacity of 1.8 Ah that loses 0.01 Ah a run, in run 41."""
    (tmp_path / "cell.toml").write_text(CELL)
    rows = [f"{k + 1},{1.8 - 0.01 * k}" for k in range(20)]
    (tmp_path / "h.csv").write_text("run,capacity\n" + "\n".join(rows))
    finer = [f"{k + 1},{1000 * (1.8 - 0.01 * k)}" for k in range(20)]
    (tmp_path / "f.csv").write_text("run,capacity [mAh]\n" + "\n".join(finer))
    with Twin.open(tmp_path / "cell.toml") as twin:
        for name in ("h.csv", "f.csv"):
            one = twin.life(tmp_path / name).components["cell"]
            assert one.indicator.limit.value == pytest.approx(1.4)
            assert one.indicator.shown(one.indicator.value[-1]) == "1.61 Ah"
            assert isinstance(one.life, Life) and one.life.median == pytest.approx(21.0, abs=0.3)


def test_what_the_twin_tuned_is_told_in_the_unit_of_the_indicator() -> None:
    rule = IndicatorSpec("wear", parameter="Fc", unit="kNm", limit=9000.0)  # settings are SI
    plain = Observed(
        np.arange(2.0), np.array([1000.0, 2000.0]), np.array([10.0, 10.0]), {}, {}, None, ()
    )
    found = in_unit(rule, plain)
    assert found.value == pytest.approx([1.0, 2.0]) and found.sigma == pytest.approx([0.01, 0.01])
    assert limit_of(rule, {}, None).value == pytest.approx(9.0)
    assert limit_of(replace(rule, limit=None), {"Fc": Limit(8000.0)}, None).value == pytest.approx(
        8
    )


def test_a_standard_deviation_is_in_the_unit_of_its_values() -> None:
    both = told("run,wear [kNm],wear.sigma [Nm]\n1,0.002,3")
    assert both.value[0] == pytest.approx(2.0) and both.sigma[0] == 3.0
    finer = told("run,wear [kNm],sigma [Nm]\n1,2,3", rule=replace(WEAR, unit="kNm"))
    assert finer.value[0] == pytest.approx(2.0) and finer.sigma[0] == pytest.approx(0.003)
    with pytest.raises(DataError, match="expected a unit in both headings, wear and sigma"):
        told("run,wear [kNm],sigma\n1,0.002,3")


def test_work_done_never_falls() -> None:
    rule = replace(WEAR, usage="work")
    assert told("run,wear,work\n1,1,0\n2,2,5", rule=rule).usage is not None
    with pytest.raises(DataError, match=r"h\.csv:3: work: expected .* never falls, got 4 after 5"):
        told("run,wear,work\n1,1,5\n2,2,4", rule=rule)


def test_values_that_never_change_are_told_as_such() -> None:
    rows = "\n".join(f"{k},5" for k in range(12))
    known = told("run,wear\n" + rows)
    life = predict_life(indicator_of(WEAR, known, Limit(9.0), "run", Parameters(())))
    assert (
        isinstance(life, NotEnough) and life.needs == "values that change: all 12 are alike so far"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("wear = -5", "s.toml:3: wear: expected a number above 0"),
        ('[limits]\ntau2 = "-3 Nm"', "s.toml:4: limits.tau2: expected a number above 0"),
        ('[path]\nmoves = "line"', "s.toml:3: path: moves: expected a list of tables"),
    ],
)
def test_a_bad_scenario_is_refused_with_its_line(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        SCENARIO.parse(f'schema = 1\nname = "s"\n{text}', "s.toml")
    assert said in str(caught.value)


@pytest.mark.parametrize("n", [12, 60, 400])
@pytest.mark.parametrize("factor", [100, 1000, 60_000])
def test_a_count_far_from_its_neighbours_is_asked_back(n: int, factor: int, tmp_path: Path) -> None:
    count = [k if k != n // 2 else factor * k for k in range(n)]
    rows = [f"{k},{1.0 + 0.01 * i:.4f}" for i, k in enumerate(count)]
    file = tmp_path / "h.csv"
    file.write_text("run,wear\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match=rf"h\.csv:{n // 2 + 2}: run: expected a time like those"):
        life_of_series(Series(file, 9.0))
    shuffled = np.random.default_rng(n).permutation(n).tolist()
    file.write_text("run,wear\n" + "".join(f"{k},{1.0 + 0.01 * k:.4f}\n" for k in shuffled))
    assert any("were sorted" in note for note in life_of_series(Series(file, 9.0)).notes)


def test_values_of_one_moment_do_not_tell_machines_apart() -> None:
    with pytest.raises(DataError, match=r"2 more such rows: delete one, or write their mean$"):
        told("run,wear\n1,2\n1,3\n2,2\n2,3\n3,2\n3,3\n")
