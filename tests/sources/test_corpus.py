"""Every broken file is read right or refused in one clear sentence; no wrong number comes out."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.sources import Cell, Clock, Recorded, inspect, render
from evertwin.sources.recording import open_recording


def _corpus() -> ModuleType:
    spec = importlib.util.spec_from_file_location("corpus", Path(__file__).with_name("corpus.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CORPUS = _corpus()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("corpus")


@pytest.fixture(scope="module")
def files(folder: Path) -> dict[str, tuple[Path, str]]:
    out = {}
    for name, (content, expected) in CORPUS.build(folder).items():
        path = folder / name
        path.write_bytes(content)
        out[name] = (path, expected)
    return out


NAMES = sorted(CORPUS.build(Path(".")))


def source(path: Path) -> Recorded:
    """x and y, by name; in a file without headings by position."""
    names = [c.name for t in open_recording(path).tables for c in t.columns]
    prefix = next((n[:-1] for n in names if n.endswith(".x")), "")
    cells = tuple(
        Cell(channel, position if names[:1] == ["c1"] else f"{prefix}{channel}", "1")
        for channel, position in (("x", 1), ("y", 2))
    )
    return Recorded("run", (path,), cells)


def check_values(name: str, t: np.ndarray, v: np.ndarray) -> None:
    """x and y belong together in every row; with them intact the stamps can be checked too."""
    x, y = v.T
    both = np.isfinite(x) & np.isfinite(y)
    np.testing.assert_allclose(y[both], -2 * (x[both] - 0.25), atol=1e-9)
    assert np.isin(np.round(x[np.isfinite(x)], 6), np.round(CORPUS.X, 6)).all()
    moved = ("clock_set", "pause", "shuffled", "reversed", "all_equal", "first_stamp")
    if not name.startswith(moved):
        np.testing.assert_allclose(x[both], 10 * t[both] * 1e-9 + 0.25, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_read_right_or_refused(name: str, files: dict[str, tuple[Path, str]]) -> None:
    path, expected = files[name]
    try:
        recorded = source(path)
        chunks = list(recorded.read())
    except DataError as error:
        assert expected in ("refused", "any"), f"{name}: {error}"
        assert str(error).startswith(name) or name in str(error)
        assert "\n" not in str(error) and len(str(error)) < 400
        return
    assert expected != "refused", f"{name} was read: {recorded.tally.lines()}"
    if expected not in ("read", "any"):
        assert recorded.tally.counts.get(expected, 0) > 0, recorded.tally.lines()
    if not chunks:
        assert expected == "any" and recorded.tally.total > 0
        return
    t = np.concatenate([c.t for c in chunks])
    v = np.concatenate([c.v for c in chunks])
    assert (np.diff(t) > 0).all()
    check_values(name, t, v)
    lost = sum(
        count for kind, count in recorded.tally.counts.items() if kind not in ("gap", "clock_set")
    )
    assert len(t) + lost >= CORPUS.N or expected in ("any", "cut_off")


@pytest.mark.parametrize("name", NAMES)
def test_info_never_breaks(name: str, files: dict[str, tuple[Path, str]]) -> None:
    path, expected = files[name]
    try:
        info = inspect(path)
    except DataError as error:
        assert expected != "read", str(error)
        return
    assert render(info).startswith(path.name)
    if expected not in ("read", "refused", "any"):
        assert info.findings


def test_no_pickle_ran(folder: Path, files: dict[str, tuple[Path, str]]) -> None:
    for path, _ in files.values():
        try:
            inspect(path)
        except DataError:
            continue
    assert not (folder / "canary").exists()


def test_the_corpus_is_large() -> None:
    assert len(NAMES) >= 100


def test_a_stated_unit_makes_an_unclear_one_clear(files: dict[str, tuple[Path, str]]) -> None:
    path, _ = files["unclear_unit.csv"]
    chunks = list(Recorded("run", (path,), (Cell("x", "x", "1"),), Clock(unit="ms")).read())
    assert chunks[0].t[1] == 20_000_000


def _mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """One byte replaced, inserted or doubled; never a digit for a digit, which nobody could see."""
    at = int(rng.integers(6, len(content)))
    new = bytes([int(rng.choice(list(b"xX;,\n\r\t\"' #\0\xff_/:")))])
    return [
        content[:at] + new + content[at + 1 :],
        content[:at] + new + content[at:],
        content[:at] + new * 3 + content[at:],
        content[:at] + content[content.index(b"\n", at - 6) + 1 :],
    ][int(rng.integers(4))]


def test_mutated_text_gives_no_wrong_number(tmp_path: Path) -> None:
    whole = CORPUS.text(CORPUS.lines())
    path = tmp_path / "run.csv"
    outcomes = {"read": 0, "refused": 0}
    for seed in range(120):
        path.write_bytes(_mutated(whole, np.random.default_rng(seed)))
        try:
            chunks = list(source(path).read())
        except DataError as error:
            assert "run.csv" in str(error)
            outcomes["refused"] += 1
            continue
        outcomes["read"] += 1
        t = np.concatenate([c.t for c in chunks])
        v = np.concatenate([c.v for c in chunks])
        assert len(t) >= CORPUS.N - 3, seed
        check_values("mutated", t, v)
    assert min(outcomes.values()) > 15
