"""MAT files of version 7.3: HDF5 with MATLAB's own marks, written here as MATLAB writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.sources import inspect, open_recording

HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema"


def put(group: Any, name: str, value: np.ndarray, kind: str = "double") -> None:
    """A variable: transposed, with the name of its class."""
    item = group.create_dataset(name, data=np.atleast_2d(value).T if value.ndim < 2 else value.T)
    item.attrs["MATLAB_class"] = np.bytes_(kind)


def written(path: Path, fill: Any) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    with path.open("r+b") as file:
        file.write(HEAD.ljust(124) + b"\x00\x02IM")
    return path


def plain(file: Any) -> None:
    t = np.arange(100) * 0.01
    put(file, "t", t)
    put(file, "q", np.c_[np.sin(t), np.cos(t)])
    put(file, "on", (t > 0.5).astype(np.uint8), "logical")
    put(file, "note", np.array([72, 105], np.uint16), "char")
    log = file.create_group("log")
    log.attrs["MATLAB_class"] = np.bytes_("struct")
    put(log, "v", 2 * t)
    file["away"] = h5py.ExternalLink("/etc/hostname", "x")
    file.create_group("#refs#")


def test_vectors_matrices_and_structures_are_columns(tmp_path: Path) -> None:
    recording = open_recording(written(tmp_path / "run.mat", plain))
    (table,) = recording.tables
    assert [(c.name, c.kind) for c in table.columns] == [
        ("log.v", "number"), ("on", "boolean"), ("q.1", "number"), ("q.2", "number"),
        ("t", "number"),
    ]  # fmt: skip
    rows = next(table.rows(["q.1", "q.2", "log.v"], "t"))
    np.testing.assert_allclose(rows.values[:, 1], np.cos(0.01 * np.arange(100)))
    np.testing.assert_allclose(rows.values[:, 2], 0.02 * np.arange(100))
    np.testing.assert_allclose(rows.time, 0.01 * np.arange(100))
    assert any("note" in note for note in recording.notes)
    assert any(note == "away: a link, which is not followed" for note in recording.notes)


def test_the_same_numbers_as_in_version_5(tmp_path: Path) -> None:
    import scipy.io

    t = np.arange(50) * 0.1
    scipy.io.savemat(tmp_path / "old.mat", {"t": t, "q": np.c_[t, t**2]})
    new = written(tmp_path / "new.mat", lambda f: (put(f, "t", t), put(f, "q", np.c_[t, t**2])))
    one, other = (inspect(path).tables[0] for path in (tmp_path / "old.mat", new))
    assert {c.name: c.mean for c in one.columns} == {c.name: c.mean for c in other.columns}


@pytest.mark.parametrize("cut", [600, 900, 2000])
def test_a_file_that_is_cut_off_is_refused(tmp_path: Path, cut: int) -> None:
    path = written(tmp_path / "run.mat", plain)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(DataError, match=r"run\.mat: damaged or cut off"):
        open_recording(path)


def test_a_plain_hdf5_file_is_no_recording(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["x"] = np.arange(3.0)
    with pytest.raises(DataError, match="HDF5"):
        open_recording(tmp_path / "x.h5")
