"""Imports go down the ladder only. The contracts stand in ``.importlinter``."""

from __future__ import annotations

import configparser
import subprocess
import sys
import tomllib
from pathlib import Path

import grimp
import pytest

import evertwin
from tools.uncalled import uncalled

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "evertwin"


def lint(folder: Path, config: Path) -> subprocess.CompletedProcess[str]:
    """Import-linter as its own process: it changes sys.path and a global registry."""
    code = "import sys; from importlinter.cli import lint_imports_command as c; c()"
    arguments = [sys.executable, "-c", code, "--config", str(config), "--no-cache"]
    return subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False)


def test_the_contracts_hold() -> None:
    result = lint(ROOT, ROOT / ".importlinter")
    assert result.returncode == 0, result.stdout + result.stderr


def test_every_room_stands_on_the_ladder() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / ".importlinter", encoding="utf-8")
    ladder = config["importlinter:contract:ladder"]
    text = (ladder["layers"] + " " + ladder["exhaustive_ignores"]).replace("(", " ")
    listed = set(text.replace(")", " ").replace("|", " ").replace(":", " ").split())
    rooms = {p.stem for p in PACKAGE.iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert rooms - {"__init__", "__pycache__"} <= listed


@pytest.mark.parametrize(
    ("low", "high"), [("fold", "models"), ("tuning", "anomaly"), ("models", "sources")]
)
def test_the_contracts_are_able_to_fail(tmp_path: Path, low: str, high: str) -> None:
    package = tmp_path / "evertwin"
    for room in ("errors", "types", "fold", "signals", "models", "sources", "tuning", "anomaly"):
        (package / room).mkdir(parents=True)
        (package / room / "__init__.py").write_text("")
    (package / "__init__.py").write_text("")
    (package / low / "__init__.py").write_text(f"import evertwin.{high}\n")
    config = configparser.ConfigParser()
    config.read(ROOT / ".importlinter", encoding="utf-8")
    for section in config.sections():
        if section not in ("importlinter", "importlinter:contract:ladder"):
            config.remove_section(section)
    with (tmp_path / ".importlinter").open("w", encoding="utf-8") as file:
        config.write(file)
    result = lint(tmp_path, tmp_path / ".importlinter")
    assert result.returncode == 1
    assert f"evertwin.{low} -> evertwin.{high}" in result.stdout


def direct_imports() -> list[tuple[str, str]]:
    """Every import inside the package as (importing room, imported room)."""
    graph = grimp.build_graph("evertwin", cache_dir=None)
    return sorted(
        {
            (module.split(".")[1], target.split(".")[1])
            for module in graph.modules
            for target in graph.find_modules_directly_imported_by(module)
            if module.count(".") and target.count(".")
        }
    )


def test_what_nothing_calls_has_its_reason() -> None:
    kept = tomllib.loads((ROOT / "tests" / "uncalled.toml").read_text(encoding="utf-8"))
    public = {name.rpartition(".")[2] for name in evertwin.__all__}
    found = {name for name in uncalled() if name.rpartition(".")[2] not in public}
    assert found == set(kept) and len(kept) <= 6


def test_what_is_called_is_told_from_what_is_not(tmp_path: Path) -> None:
    package = tmp_path / "house"
    package.mkdir()
    (package / "__init__.py").write_text("from house.roof import tile\n__all__ = ['tile']\n")
    (package / "roof.py").write_text(
        "def tile(): pass\ndef nail(): return nail()\ndef beam(): pass\ndef rain(): pass\n"
        "def gable(): return beam()\nPLUGINS = {'x': 'house.roof:gable'}\n"
    )
    (package / "work.py").write_text("from house import roof as r\nr.rain()\n")
    assert uncalled(package) == ["house.roof.tile", "house.roof.nail"]


def test_a_world_knows_signals_sources_and_lines_at_most() -> None:
    known = {target for room, target in direct_imports() if room == "worlds"}
    assert known <= {"worlds", "signals", "sources", "fold", "errors", "types", "ros", "backoff"}


def test_a_twin_cannot_see_a_world() -> None:
    assert {room for room, target in direct_imports() if target == "worlds"} <= {"worlds", "app"}
