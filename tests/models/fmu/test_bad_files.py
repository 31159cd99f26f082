"""Files that nobody vouches for; `proofs.bad_files` prints the figures over all of them."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import ModelError
from evertwin.machines.arm import urdf
from evertwin.models.fmu import fmu
from evertwin.models.fmu.description import parse_description
from evertwin.models.fmu.guard import Unpacking, opened, unpack

from . import corpus
from .native import description, library


@pytest.mark.parametrize(
    ("name", "raw"),
    list(corpus.archives(large=False)),
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_archive_is_refused_before_unpacking(name: str, raw: bytes, tmp_path: Path) -> None:
    file = tmp_path / "in" / "bad.fmu"
    file.parent.mkdir()
    file.write_bytes(raw)
    with pytest.raises(ModelError, match=r"^bad\.fmu"):
        fmu(file, memory="none")
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["bad.fmu", "in"]


def test_limits_are_settings(tmp_path: Path) -> None:
    file = tmp_path / "a.fmu"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for k in range(3):
            archive.writestr(f"resources/{k}", bytes(2_000_000))
    for limits, words in (
        (Unpacking(files=2), "holds 3 files, expected at most 2"),
        (Unpacking(size=3_000_000), "would unpack to 6 MB, expected at most 3 MB"),
        (Unpacking(ratio=10.0), "times its size, expected at most 10"),
    ):
        with pytest.raises(ModelError, match=words), opened(file, limits):
            pass
    with opened(file, Unpacking(ratio=1e9)) as archive:
        target = tmp_path / "out"
        assert unpack(archive, target, "a", Unpacking(ratio=1e9), ("resources/1",)) == 2_000_000
        assert [p.name for p in target.rglob("*") if p.is_file()] == ["1"]


@pytest.mark.parametrize(
    ("version", "words"),
    [("1.0", "got FMI 1.0"), ("4.0", "got FMI 4.0"), ("", "expected an FMU of FMI 2.0 or 3.0")],
)
def test_other_versions_are_refused(version: str, words: str) -> None:
    text = description(False, "c", False, True).replace(
        'fmiVersion="2.0"', f'fmiVersion="{version}"'
    )
    with pytest.raises(ModelError, match=words):
        parse_description(text.encode(), "x")


def test_missing_platforms_are_named(tmp_path: Path) -> None:
    file = tmp_path / "mass.fmu"
    for folders, words in (
        (["win64", "darwin64"], "expected a library for linux64, the FMU has darwin64, win64"),
        ([], "has none"),
    ):
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("modelDescription.xml", description(False, "c", False, True))
            for folder in folders:
                archive.writestr(f"binaries/{folder}/mass.dll", b"MZ")
        with pytest.raises(ModelError, match=words):
            fmu(file)


def test_a_library_that_is_none(tmp_path: Path) -> None:
    file = tmp_path / "mass.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", description(False, "c", False, True))
        archive.writestr("binaries/linux64/mass.so", b"text")
    with pytest.raises(ModelError, match=r"mass\.fmu: .*Failed to load shared library"):
        fmu(file)


def test_units_are_converted_and_missing_ones_told(tmp_path: Path) -> None:
    text = description(False, "c", False, True)
    text = text.replace('start="0" unit="m"/', 'start="0" unit="mm"/').replace('unit="W"', "")
    file = tmp_path / "mass.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.write(library(tmp_path, False, ""), "binaries/linux64/mass.so")
    model = fmu(file)
    assert model.outputs.units == ("m", "m/s", "1")
    assert "no unit is given for power" in " ".join(model.notes)
    p = model.parameters.values
    _, y = model.simulate(np.array([0.5, 1.0]), np.zeros((1, 1)), np.array([1e-3]), p)
    assert y[0, 0] == pytest.approx(0.5 + 1e-6, abs=1e-8), "1 m/s in a unit of mm is 1 mm/s"
    model.close()


@pytest.mark.parametrize(("name", "text", "word"), list(corpus.urdfs()), ids=lambda v: v[:20])
def test_a_urdf_is_refused_by_element(name: str, text: str, word: str) -> None:
    with pytest.raises(ModelError) as caught:
        urdf.parse(text, "arm.urdf")
    assert str(caught.value).startswith("arm.urdf") and word in str(caught.value)


def test_meshes_are_named_and_never_opened() -> None:
    for name, text in corpus.meshes():
        assert name in " ".join(urdf.parse(text).notes)
