"""The demonstration: both embedded machines record, both twins improve themselves.

The arm records, in a process of its own, while the robot's twin runs; what each twin makes of its
recording is told as soon as it is known.
"""

from __future__ import annotations

from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from evertwin.app.console import Alive, show
from evertwin.app.machine.recording_processes import arm, robot
from evertwin.errors import UsageError

if TYPE_CHECKING:
    from evertwin.outcome import RunResult


def shipped(file: str) -> Path:
    """A file that comes with the package, such as ``twins/arm.toml``.

    Raises:
        UsageError: it does not.
    """
    for root in (Path(str(files("evertwin.app"))), Path(__file__).parents[4]):
        if (root / file).is_file():
            return root / file
    raise UsageError(f"{file} does not lie with the package: install evertwin again")


def run_demo(out: Path, seed: int, as_json: bool) -> None:
    """Records, runs, reports; figures on stdout."""
    found: dict[str, Any] = {"schema": "evertwin.demo/1"}
    out.mkdir(parents=True, exist_ok=True)
    with Alive() as alive, ExitStack() as worlds:
        alive.say("robot: the embedded robot drives (MuJoCo, a process of its own)")
        drives = worlds.enter_context(
            robot(out / "robot.csv", "--world", "w3", "--seed", f"{seed}")
        )
        _prepare()
        recorded = drives.recordings()
        alive.say("arm: the embedded arm welds three circles (MuJoCo, a process of its own)")
        welds = worlds.enter_context(arm(out / "arm", "--cycles", "3", "--seed", f"{seed}"))
        found["robot"] = _shown("robot", recorded, out, alive, as_json)
        found["arm"] = _shown("arm", welds.recordings(), out, alive, as_json)
    if as_json:
        show(found, "", as_json)


def _prepare() -> None:
    """Loads what the twins need while the first machine still records."""
    import evertwin.loop.run
    import evertwin.report.run_report  # noqa: F401


def _shown(
    name: str, recordings: list[Path], out: Path, alive: Alive, as_json: bool
) -> dict[str, Any]:
    """One machine's result, on stdout unless one document is asked for; then its report."""
    from evertwin.report.run_report import write_report
    from evertwin.twin import Twin

    alive.say(f"{name}: running the twin beside {len(recordings)} recording(s)")
    report = out / f"{name}.html"
    with Twin.open(shipped(f"twins/{name}.toml")) as twin:
        result = twin.run([str(path) for path in recordings])
        if not as_json:
            typer.echo(f"{result}\n{_said(result)}")
        alive.say(f"{name}: drawing the report")
        write_report(result, twin.setup, report)
    if not as_json:
        typer.echo(f"report: {report}\n")
    return result.to_dict() | {"report": str(report)}


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
