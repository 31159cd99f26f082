"""A fleet: histories and stores of like machines, each life labelled, sudden ends said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config import spec
from evertwin.errors import DataError, UsageError
from evertwin.prognosis.laws import Life
from evertwin.prognosis.laws.wear.hypotheses import LAWS
from evertwin.prognosis.likes.like_machines import files_of
from evertwin.prognosis.outlook.course import course
from evertwin.prognosis.outlook.lone_series import Series, life_of_series
from evertwin.store import Batch, Checkpoint, Estimate, SqliteStore
from planted.draws import first_of


def grown(file: Path, life: float, until: int, seed: int, last: str = "") -> Path:
    """Wear that passes 2 after ``life`` runs."""
    rng = np.random.default_rng(seed)
    y = 1.0 + np.arange(until) / life + 0.01 * rng.standard_normal(until)
    rows = [f"{k},{v:.5f},{last if k == until - 1 else ''}" for k, v in enumerate(y)]
    file.write_text("run,wear,maintenance\n" + "\n".join(rows))
    return file


def stored(file: Path, life: float, until: int, seed: int) -> Path:
    """The store of a twin that tuned the same wear."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(until):
        value = 1.0 + k / life + 0.01 * rng.standard_normal()
        fit = Estimate(10 * k, k * 10**9, 0, "wear", value, value - 0.02, value + 0.02,
                       task=k, elapsed=k * 10**9)  # fmt: skip
        rows.append(fit)
    store = SqliteStore(file)
    store.commit(Batch(records=tuple(rows), checkpoint=Checkpoint(10 * until, (1.5,))))
    store.close()
    return file


def test_every_member_is_labelled(tmp_path: Path) -> None:
    own = grown(tmp_path / "own.csv", 110.0, 60, 0)
    fleet = (
        grown(tmp_path / "a.csv", 100.0, 105, 1), grown(tmp_path / "b.csv", 110.0, 115, 2),
        grown(tmp_path / "c.csv", 120.0, 70, 3), grown(tmp_path / "d.csv", 120.0, 90, 4, "failed"),
        stored(tmp_path / "arm2.db", 105.0, 110, 5),
    )  # fmt: skip
    found = life_of_series(Series(own, 2.0, column="wear", fleet=fleet))
    one = found.to_dict()["components"]["wear"]  # type: ignore[call-overload, index]
    how = {m["name"]: m["how"] for m in one["fleet"]}  # type: ignore[call-overload, index, union-attr]
    assert how == {"a.csv": "limit", "b.csv": "limit", "c.csv": "running", "d.csv": "failed",
                   "arm2.db": "limit"}  # fmt: skip
    told = str(found)
    assert "fleet: 4 ended, at 89 to" in told and "c.csv still running at 69 run" in told
    assert "1 of 4 like machines failed before the limit (d.csv)" in told
    life = found.components["wear"].life
    assert isinstance(life, Life) and life.interval80[0] < 50.0 < life.interval80[1]
    said = life_of_series(Series(own, 2.0, column="wear", fleet=fleet[:3], failed=fleet[2:3]))
    assert "c.csv" in str(said) and "failed before the limit" in str(said)


def test_the_stores_of_several_twins_are_a_fleet(tmp_path: Path) -> None:
    for k, life in enumerate((90.0, 100.0, 110.0)):
        stored(tmp_path / f"arm{k}.db", life, int(life) + 5, k)
    stored(tmp_path / "own.db", 100.0, 60, 7)
    rule = spec.IndicatorSpec("wear", parameter="wear", limit=2.0)
    twin = TwinSpec(
        "arm", spec.ModelSpec("robot1d"), indicator=(rule,), folder=str(tmp_path),
        store=spec.StoreSpec(path="own.db"), prognosis=spec.PrognosisSpec(fleet=("*.db",)),
    )  # fmt: skip
    with Twin(twin) as opened:
        found = opened.life()
    assert "fleet: 3 ended, at 89" in str(found) and "own.db" not in str(found)
    told = found.components["wear"].life
    assert isinstance(told, Life) and abs(told.median - 40.0) < 8.0


def test_a_fleet_of_another_pace_is_said_and_the_course_is_its_own(tmp_path: Path) -> None:
    fleet = tuple(
        grown(tmp_path / f"{k}.csv", life, int(life) + 5, k)
        for k, life in enumerate((46.0, 48.0, 50.0, 52.0, 54.0))
    )
    own = grown(tmp_path / "own.csv", 100.0, 50, 9)
    found = life_of_series(Series(own, 2.0, column="wear", fleet=fleet))
    one = found.components["wear"]
    assert isinstance(one.life, Life) and one.life.pace == pytest.approx(1.9, abs=0.25)
    assert one.life.interval80[0] < 50.0 < one.life.interval80[1]
    assert (
        f"wear takes {one.life.pace:.2g} times as long as its like machines did for the same wear"
        in str(found)
    )
    assert one.sentence.endswith(", by like machines")
    way = course(one.indicator, one.life, LAWS, one.fleet)
    assert way is not None and way.levels[-1] == pytest.approx(2.0)
    passed = way.times((0.5,))[:, 0]
    assert passed[0] == 0.0 and (np.diff(passed) >= 0.0).all()
    assert passed[4] == pytest.approx(0.5 * one.life.median, rel=0.3)
    assert passed[-1] == pytest.approx(one.life.median)
    alike = grown(tmp_path / "alike.csv", 50.0, 25, 10)
    assert "times as long" not in str(
        life_of_series(Series(alike, 2.0, column="wear", fleet=fleet))
    )


def test_lives_before_a_replacement_count_too(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    y = [*(1.0 + np.arange(100) / 95.0), *(1.0 + np.arange(50) / 95.0),
         *(1.0 + np.arange(30) / 95.0)]  # fmt: skip
    rows = [f"{k},{v + 0.01 * rng.normal():.4f},{'replaced' if k in (100, 150) else ''}"
            for k, v in enumerate(y)]  # fmt: skip
    twice = tmp_path / "twice.csv"
    twice.write_text("run,wear,maintenance\n" + "\n".join(rows))
    other = grown(tmp_path / "a.csv", 100.0, 105, 1)
    own = grown(tmp_path / "own.csv", 110.0, 60, 0)
    told = str(life_of_series(Series(own, 2.0, column="wear", fleet=(twice, other))))
    assert "twice.csv replaced in time at 49 run, twice.csv still running at 29 run" in told
    assert "fleet: 2 ended" in told
    with pytest.raises(UsageError, match=r"at least two lives that ended .*--failed\), got "):
        life_of_series(Series(own, 2.0, column="wear", fleet=(other,)))
    with pytest.raises(UsageError, match="none/"):
        files_of(("none/*.csv",), tmp_path)


def test_a_life_that_failed_before_its_limit_is_over(tmp_path: Path) -> None:
    own = grown(tmp_path / "own.csv", 110.0, 60, 0, "failed")
    found = life_of_series(Series(own, 2.0, column="wear"))
    assert "life is over: it failed at 59 run" in str(found)
    assert [a.kind for a in found.alarms] == ["limit_passed"]
    assert "it has failed" in found.alarms[0].reason


def machine(file: Path, seed: int, way: tuple[float, float, float], share: float = 1.1) -> Path:
    """Wear from ``begin`` to 5 by a power, over about 100 units of the clock."""
    begin, power, spread = way
    rng = np.random.default_rng(seed)
    life = 100.0 * np.exp(spread * rng.standard_normal())
    k = np.arange(int(share * life))
    y = begin + (5.0 - begin) * (k / life) ** power + 0.04 * rng.standard_normal(len(k))
    file.write_text("run,wear\n" + "\n".join(f"{a},{b:.4f}" for a, b in zip(k, y, strict=True)))
    return file


@pytest.mark.parametrize("share", [0.5, 0.8])
@first_of("seed", range(4))
def test_a_fleet_of_another_type_is_said_and_left_out(
    seed: int, share: float, tmp_path: Path
) -> None:
    own = machine(tmp_path / "own.csv", seed, (2.0, 1.0, 0.0), share)
    alone = life_of_series(Series(own, 5.0)).components["wear"].sentence
    for name, begin, power, why in (
        ("late", 2.0, 8.0, "by a course of another shape"),
        ("near", 4.0, 1.0, "began much nearer to the limit"),
        ("like", 2.0, 1.0, ""),
        ("bent", 2.1, 1.3, ""),
    ):
        fleet = tuple(
            machine(tmp_path / f"{name}{k}.csv", 50 + 7 * seed + k, (begin, power, 0.15))
            for k in range(5)
        )
        told = life_of_series(Series(own, 5.0, fleet=fleet))
        assert (told.components["wear"].sentence == alone) == bool(why), name
        left = [note for note in told.notes if "left out" in note]
        assert len(left) == bool(why) and all(why in note for note in left)


def test_the_only_column_of_another_name_is_taken_and_several_are_asked(tmp_path: Path) -> None:
    own = grown(tmp_path / "own.csv", 110.0, 60, 0)
    fleet = tuple(grown(tmp_path / f"{k}.csv", 100.0 + k, 115, k) for k in range(3))
    alike = life_of_series(Series(own, 2.0, column="wear", fleet=fleet))
    for file in fleet:
        file.write_text(file.read_text().replace("run,wear", "run,vibration"))
    told = life_of_series(Series(own, 2.0, column="wear", fleet=fleet))
    note = "wear: its like machines tell vibration, their only column: the same?"
    assert told.notes.count(note) == 1 and note not in alike.notes
    assert told.components["wear"].sentence == alike.components["wear"].sentence
    first, *rows = fleet[1].read_text().splitlines()
    wider = [f"{first},temp", *(f"{row},{20 + k % 7}" for k, row in enumerate(rows))]
    fleet[1].write_text("\n".join(wider))
    with pytest.raises(DataError, match=r"1\.csv: expected a column 'wear'.*got vibration, temp: "):
        life_of_series(Series(own, 2.0, column="wear", fleet=fleet))


@pytest.mark.parametrize("head", ["s", "h", "d", "t", "date"])
def test_a_fleet_that_counts_by_another_clock_is_refused(head: str, tmp_path: Path) -> None:
    own = grown(tmp_path / "own.csv", 110.0, 60, 0)
    fleet = tuple(grown(tmp_path / f"{k}.csv", 100.0 + k, 110, k) for k in range(3))
    for file in fleet:
        first, *rows = file.read_text().splitlines()
        rows = [f"2025-01-01T{int(r.split(',')[0]) // 60:02d}:{int(r.split(',')[0]) % 60:02d},"
                f"{r.partition(',')[2]}" if head == "date" else r for r in rows]  # fmt: skip
        file.write_text("\n".join([first.replace("run", head), *rows]))
    with pytest.raises(DataError, match=f"expected a column 'run'.*, got {head}: add one"):
        life_of_series(Series(own, 2.0, column="wear", fleet=fleet))


@pytest.mark.parametrize(("earlier", "likes"), [(3, False), (5, True)])
def test_earlier_lives_of_the_machine_are_like_machines(
    earlier: int, likes: bool, tmp_path: Path
) -> None:
    rng, rows, begun = np.random.default_rng(earlier), ["h,wear,maintenance"], 0.0
    for number in range(earlier + 1):
        life = float(rng.uniform(90.0, 110.0))
        for age in np.arange(0.0, 0.6 * life if number == earlier else life + 3.0):
            wear = 2.0 * (age / life) ** 2 + 0.02 * rng.standard_normal()
            said = "replaced" if number and age == 0.0 else ""
            rows.append(f"{begun + age:.1f},{wear:.4f},{said}")
        begun += age + 1.0
    file = tmp_path / "pump.csv"
    file.write_text("\n".join(rows) + "\n")
    told = life_of_series(Series(file, 2.0)).components["wear"]
    assert (told.fleet is not None) == likes
    assert isinstance(told.life, Life)
    low, high = told.life.interval80
    assert low < 0.4 * life < high
    assert (high < 2.5 * low) == likes
