"""Every folder of real recordings is read, with the figures that its description states."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evertwin.sources import Cell, Clock, Recorded, inspect, merge

pytestmark = pytest.mark.data
LIST = Path(__file__).parents[2] / "twins" / "data-sets.sha256"
DataSet = Callable[[str], Path]


def read(source: Recorded) -> tuple[np.ndarray, np.ndarray]:
    chunks = list(source.read())
    return np.concatenate([c.t for c in chunks]), np.concatenate([c.v for c in chunks])


def test_files_are_those_of_the_list(data_dir: Path) -> None:
    for line in LIST.read_text(encoding="utf-8").splitlines():
        digest, file = line.split("  ")
        with (data_dir / file).open("rb") as opened:
            assert hashlib.file_digest(opened, "sha256").hexdigest() == digest, file


@pytest.mark.parametrize("part", ["identification", "jointwise", "load_pair"])
def test_ur10e(part: str, data_set: DataSet) -> None:
    files = sorted((data_set("ur10e") / part).glob("*.csv"))
    cells = tuple(Cell(f"c{j}", j, "1") for j in range(1, 31))
    for path in files:
        source = Recorded("arm", (path,), cells, Clock(0, "s"))
        t, v = read(source)
        assert source.tally.total == 0 and np.isfinite(v).all()
        assert 20 < (t[-1] - t[0]) * 1e-9 < 90 and len(t) > 2000
        assert np.diff(t).min() * 1e-9 > 0.0019 and np.diff(t).max() * 1e-9 < 0.1
        assert (np.rint(t / 1e6) * 1e6 == t).all()  # the file has milliseconds


def test_emps(data_set: DataSet) -> None:
    path = data_set("emps") / "DATA_EMPS.mat"
    t, v = read(Recorded("axis", (path,), (Cell("q", "qm", "m"), Cell("u", "vir", "V"))))
    assert len(t) == 24_841 and t[-1] == 24_840_000_000
    assert np.abs(np.diff(t) - 1_000_000).max() < 50
    assert np.isfinite(v).all()


def test_drive_warthog(data_set: DataSet) -> None:
    path = data_set("drive_warthog") / "warthog_windows.csv"
    cells = (Cell("left", "cmd_left", "rad/s"), Cell("x", "icp_x", "m"))
    chunks = list(Recorded("base", (path,), cells, Clock(rate=20.0), "window").read())
    assert len({c.task for c in chunks}) == 360
    assert sum(len(c.t) for c in chunks) == 14_400
    summary = inspect(path.with_name("warthog_window_summary.csv"))
    assert summary.tables[0].rows == 360


@pytest.mark.parametrize("robot", range(1, 6))
def test_mrclam6(robot: int, data_set: DataSet) -> None:
    folder = data_set("mrclam6")
    odometry = Recorded(
        "odometry", (folder / f"Robot{robot}_Odometry.dat.gz",),
        (Cell("v", "forward velocity", "m/s"), Cell("w", "angular velocity", "rad/s")),
    )  # fmt: skip
    truth = Recorded(
        "truth", (folder / f"Robot{robot}_Groundtruth.dat.gz",),
        (Cell("x", "x", "m"), Cell("y", "y", "m"), Cell("heading", 3, "rad")),
    )  # fmt: skip
    chunks = list(merge([odometry.read(), truth.read()]))
    t = np.concatenate([c.t for c in chunks if c.source == "odometry"])
    assert 755 < (t[-1] - t[0]) * 1e-9 < 900
    assert t[0] // 10**9 == 1_248_444_187 or t[0] > 1_248_000_000 * 10**9
    assert set(odometry.tally.counts) <= {"gap", "repeated"}
    assert set(truth.tally.counts) <= {"gap", "repeated"}
    assert truth.tally.counts.get("repeated", 0) + odometry.tally.counts.get("repeated", 0) < 20
    for name in ("Barcodes", "Landmark_Groundtruth", f"Robot{robot}_Measurement"):
        assert inspect(folder / f"{name}.dat.gz").tables[0].rows > 10


def test_incubator(data_set: DataSet) -> None:
    folder = data_set("incubator")
    cells = (
        Cell("t2", "t2", "degC"), Cell("t3", "t3", "degC"), Cell("heater", "heater_on", "1"),
    )  # fmt: skip
    for path in sorted(folder.rglob("*.csv")):
        if path.name == "events.csv":
            assert inspect(path).tables[0].rows == 16
            continue
        t, v = read(Recorded("box", (path,), cells))
        assert abs(np.median(np.diff(t)) - 3.04e9) < 0.1e9
        assert ((v[:, :2] > 290) & (v[:, :2] < 345)).all() and set(v[:, 2]) <= {0.0, 1.0}
    march = folder / "20210321_lid_opening_7pmodel" / "lid_opening_experiment_mar_2021.csv"
    assert read(Recorded("box", (march,), cells))[0][0] == 1_614_859_007_119_846_022


@pytest.mark.parametrize(
    ("name", "file", "rows"),
    [
        ("bearing_ims2", "2nd_test_resmaple_10minutes.csv", 984),
        ("battery", "capacity.csv", 336),
        ("cmapss_fd001", "train_FD001.txt", 20_631),
        ("cmapss_fd001", "test_FD001.txt", 13_096),
        ("cmapss_fd001", "RUL_FD001.txt", 100),
    ],
)
def test_the_other_tables(name: str, file: str, rows: int, data_set: DataSet) -> None:
    info = inspect(data_set(name) / file)
    assert info.tables[0].rows == rows and not info.tables[0].problems


def test_a_log_of_scans_says_what_its_stamps_and_odometry_are(data_set: DataSet) -> None:
    info = inspect(data_set("laser_intel") / "intel-lab.log")
    assert info.tables[0].rows == 2672 and info.tables[0].problems["backward"] == 105
    assert any("this log has no odometry of its own" in finding for finding in info.findings)
