"""OpenModelica as the other way, held against a stand-in: no omc runs in these tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.errors import ModelError, UsageError
from evertwin.machines.catalog import machine
from evertwin.models.modelica.openmodelica import exported


def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "omc").write_text(f"#!/bin/sh\n{body}\n")
    (folder / "omc").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")


def test_it_is_asked_for_an_fmu_of_both_kinds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, monkeypatch, 'cp "$1" P.Drive.fmu')
    script = exported(str(tmp_path / 'a "b".mo'), "P.Drive", (str(tmp_path / "L.mo"),)).read_text()
    assert 'buildModelFMU(P.Drive, version="2.0", fmuType="me_cs")' in script
    assert r"a \"b\".mo" in script
    assert script.index("L.mo") < script.index("Evertwin.mo") < script.index(r"\"b\"")


def test_what_it_says_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(tmp_path, monkeypatch, "echo 'Error: Class Drive not found'; exit 1")
    with pytest.raises(ModelError, match="no FMU of Drive: Error: Class Drive not found"):
        machine("modelica", {"file": "D.mo", "model": "Drive", "via": "openmodelica"})


def test_it_is_ended_after_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(tmp_path, monkeypatch, "exec sleep 20")
    with pytest.raises(ModelError, match=r"longer than 0\.2 s"):
        machine("modelica", {"file": "D.mo", "model": "D", "via": "openmodelica", "limit": 0.2})


def test_misuse_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="expected rumoca or openmodelica"):
        machine("modelica", {"model": "Evertwin.Axis", "via": "dymola"})
    stand_in(tmp_path, monkeypatch, "true")
    with pytest.raises(UsageError, match="name of a model"):
        exported("D.mo", 'D); system("touch x"')
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UsageError, match="no 'omc' on the PATH"):
        exported("D.mo", "D")
