"""The demonstration: both embedded machines record, both twins improve themselves."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import typer

from evertwin.app.console import show
from evertwin.app.worlds import record_arm, record_robot
from evertwin.errors import UsageError
from evertwin.loop.result import RunResult
from evertwin.report.run_report import write_report
from evertwin.twin import Twin


def twin_file(name: str) -> Path:
    """A twin file that comes with the package."""
    inside = Path(str(files("evertwin.app").joinpath("twins", f"{name}.toml")))
    beside = Path(__file__).parents[3] / "twins" / f"{name}.toml"
    for path in (inside, beside):
        if path.is_file():
            return path
    raise UsageError(f"{name}.toml does not lie with the package: install evertwin again")


def run_demo(out: Path, seed: int, as_json: bool) -> None:
    """Records, runs, reports; figures on stdout."""
    found: dict[str, Any] = {"schema": "evertwin.demo/1"}
    text = []
    for name, recordings in (("robot", _robot(out, seed)), ("arm", _arm(out, seed))):
        typer.echo(f"{name}: running the twin beside {len(recordings)} recording(s)", err=True)
        twin = Twin.open(twin_file(name))
        result = twin.run(recordings)
        report = out / f"{name}.html"
        write_report(result, twin.setup, report)
        twin.close()
        found[name] = result.to_dict() | {"report": str(report)}
        text += [str(result), _said(result), f"report: {report}", ""]
    show(found, "\n".join(text).rstrip(), as_json)


def _robot(out: Path, seed: int) -> list[str]:
    path = out / "robot.csv"
    typer.echo("robot: the embedded robot drives (MuJoCo, a process of its own)", err=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    record_robot(path, "--world", "w3", "--seed", str(seed))
    return [str(path)]


def _arm(out: Path, seed: int) -> list[str]:
    folder = out / "arm"
    typer.echo("arm: the embedded arm welds three circles (MuJoCo, a process of its own)", err=True)
    record_arm(folder, "--cycles", "3", "--seed", str(seed))
    return [str(path) for path in sorted(folder.glob("*.csv"))]


def _said(result: RunResult) -> str:
    """What happened, in one sentence."""
    if not result.of_kind("promoted"):
        return "Nothing was promoted: the recording gave no sufficient evidence."
    before, after = result.position_updates
    if before:
        return f"Position updates over the same unseen rows: {before} before, {after} after."
    worst = max(f.relative_rms_moving_after for f in result.outputs.values())
    first = max(f.relative_rms_moving_before for f in result.outputs.values())
    shown = f"{100 * first:.1f} % before, {100 * worst:.1f} % after"
    return f"Worst torque deviation while moving: {shown}."
