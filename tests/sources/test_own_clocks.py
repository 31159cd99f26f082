"""Signals with clocks of their own in one MAT or NumPy file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy

from evertwin.sources import Recording, open_recording
from evertwin.sources.columns.cells import Cell
from evertwin.sources.recorded import Clock, Recorded
from evertwin.starter import look, mapped

FAST, SLOW = np.arange(0.0, 60.0, 0.5), np.arange(0.0, 60.0, 2.0)
PUMP, LEVEL = np.repeat([40.0, 55.0, 30.0], 40), 50.0 + np.cumsum(np.sin(SLOW / 9.0))


def _series(t: np.ndarray, data: np.ndarray, unit: str) -> dict[str, Any]:
    """As MATLAB's timeseries look once they are structures."""
    return {
        "Time": t[:, None], "Data": data[:, None], "Name": "x", "DataInfo": {"Units": unit},
        "TimeInfo": {"Units": "seconds"},
    }  # fmt: skip


def _timeseries(path: Path) -> Path:
    log = {"pump": _series(FAST, PUMP, "%"), "flow": _series(FAST, PUMP * 8.0, "l/min"),
           "level": _series(SLOW, LEVEL, "cm")}  # fmt: skip
    scipy.io.savemat(path, {"log": log})
    return path


def _simulink(path: Path) -> Path:
    """'Structure with time' of two To Workspace blocks."""
    scipy.io.savemat(path, {
        "out": {"time": FAST[:, None], "signals": {"values": PUMP[:, None], "label": "pump"}},
        "level": {"time": SLOW[:, None], "signals": {"values": LEVEL[:, None], "label": "level"}},
    })  # fmt: skip
    return path


def _new(path: Path) -> Path:
    """Version 7.3: HDF5, transposed, classes named, texts as numbers."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, t, data, unit in (("pump", FAST, PUMP, "%"), ("level", SLOW, LEVEL, "cm")):
            group = file.create_group(name)
            group.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, value in (("Time", t), ("Data", data)):
                group.create_dataset(key, data=value[None]).attrs["MATLAB_class"] = np.bytes_(
                    "double"
                )
            info = group.create_group("DataInfo")
            info.attrs["MATLAB_class"] = np.bytes_("struct")
            text = info.create_dataset("Units", data=np.array([[ord(c)] for c in unit], np.uint16))
            text.attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, written by a test".ljust(124) + b"\x00\x02IM")
    return path


def _arrays(path: Path) -> Path:
    np.savez(path, t_fast=FAST, pump=PUMP, t_slow=SLOW, level=LEVEL)
    return path


@pytest.mark.parametrize(
    ("write", "name", "units"),
    [(_timeseries, "a.mat", True), (_simulink, "b.mat", False), (_new, "c.mat", True),
     (_arrays, "d.npz", False)],
)  # fmt: skip
def test_every_signal_is_read_on_its_own_clock(
    write: Any, name: str, units: bool, tmp_path: Path
) -> None:
    recording = open_recording(write(tmp_path / name))
    assert not recording.notes
    assert len(recording.tables) == 2
    for signal, t, data, unit in (("pump", FAST, PUMP, "%"), ("level", SLOW, LEVEL, "cm")):
        column = _column(recording, signal)
        source = Recorded(signal, (tmp_path / name,), (Cell(signal, column, "1"),), Clock(unit="s"))
        rows = [(chunk.t, chunk.v[:, 0]) for chunk in source.read()]
        np.testing.assert_allclose(np.concatenate([a for a, _ in rows]) * 1e-9, t)
        np.testing.assert_allclose(np.concatenate([b for _, b in rows]), data)
        assert recording.find(column)[1].unit == (unit if units else "")


def _column(recording: Recording, signal: str) -> str:
    of = "out" if signal == "pump" and recording.path.name == "b.mat" else signal
    names = [c.name for table in recording.tables for c in table.columns]
    return next(n for n in names if of in n.split(".") and n.split(".")[-1].lower() != "time")


def test_the_slow_signal_is_the_output_of_a_model_of_ones_own(tmp_path: Path) -> None:
    seen, _ = look([_timeseries(tmp_path / "pump.mat")])
    found = {m.channel: m.column for m in mapped(None, seen).matches}
    assert found == {"u": "log.pump.Data", "y": "log.level.Data"}


def test_what_has_no_clock_is_named(tmp_path: Path) -> None:
    file = tmp_path / "run.mat"
    scipy.io.savemat(file, {"t": FAST, "pump": PUMP, "level": LEVEL})
    recording = open_recording(file)
    assert recording.notes == (f"level: {len(LEVEL)} rows, the table has {len(FAST)}",)
    assert [c.name for c in recording.tables[0].columns] == ["t", "pump"]


def test_thousands_of_series_take_no_time(tmp_path: Path) -> None:
    file = tmp_path / "many.npz"
    series = {f"s{i}.{key}": FAST for i in range(1500) for key in ("Time", "Data")}
    np.savez(file, **series)
    (table,) = open_recording(file).tables
    assert len(table.columns) == 1501
