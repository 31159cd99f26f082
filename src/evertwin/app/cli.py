"""The command line: ``evertwin COMMAND``. Data goes to stdout, progress and logs to stderr.

Commands are thin: each parses, calls the Python interface, and prints. What a command needs is
imported when it runs, so that ``--help`` stays fast.
"""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer

from evertwin.app.machine import cli_machine
from evertwin.app.options import PART, AsJson, Check, Force, Number, Report, TwinFile
from evertwin.app.outlook import cli_outlook
from evertwin.app.perception import cli_features, cli_map
from evertwin.app.site import cli_site
from evertwin.app.store import cli_store
from evertwin.app.twin import cli_model, cli_twin
from evertwin.errors import EvertwinError

app = typer.Typer(
    name="evertwin",
    help="Keeps the model of a machine true to the machine.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
KINDS = (
    "Kind of machine: arm (torques from motion, with --urdf), differential, omni or bicycle "
    "(pose of a base; a steered one), odometer (way and heading), robot1d (way along a line), "
    "drive (an axis moved by a force), drive_force (its force from motion), thermal (a heated "
    "box), python (your own). Default: differential for a pose with v and w commands, else python."
)
MOST, LONGEST = 50, 500
"""Lines of an error that are shown, and signs of a line."""
Workers = Annotated[
    int | None,
    typer.Option(help="Processes for slow work; 0: none but this. Default: as the twin file says."),
]
DataFiles = Annotated[
    list[Path] | None,
    typer.Option("--data", help="Recordings in place of the twin file's; list several." + PART),
]


def _version(value: bool) -> bool:
    if value:
        from importlib.metadata import version

        typer.echo(version("evertwin"))
        raise typer.Exit
    return value


@app.callback()
def _options(
    verbose: Annotated[
        int, typer.Option("-v", "--verbose", count=True, help="Log to stderr; twice for more.")
    ] = 0,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Keeps the model of a machine true to the machine."""
    if verbose:
        logging.basicConfig(
            stream=sys.stderr,
            level=logging.INFO if verbose == 1 else logging.DEBUG,
            format="%(levelname)s %(name)s: %(message)s",
        )
    else:  # a pause that would be longer than others
        compiling = logging.getLogger("evertwin.compiled")
        compiling.setLevel(logging.INFO)
        compiling.handlers = [logging.StreamHandler()]


app.registered_commands += cli_machine.app.registered_commands  # the demonstration comes first


@app.command()
def run(
    twin: TwinFile,
    data: DataFiles = None,
    report: Report = None,
    as_json: AsJson = False,
    check: Check = False,
    again: Annotated[
        bool, typer.Option("--again", help="As a new run, also rows that have been run before.")
    ] = False,
    every: Annotated[bool, typer.Option("--events", help="Every event, one a line.")] = False,
    workers: Workers = None,
) -> None:
    """Run a twin beside recorded data: judge, tune, correct, try in shadow, promote.

    With [store] path it goes on where it stopped, and runs no row twice.
    Example: evertwin run robot.toml --data monday.csv --report monday.html
    """
    from evertwin.app.twin.twin_commands import run_twin

    run_twin(twin, data, report, (as_json, every, check), again, workers)


@app.command()
def kpi(
    twin: TwinFile,
    data: DataFiles = None,
    changed: Annotated[
        float | None, typer.Option(help="When the machine was changed [s of data].")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run a twin, and tell what it is compared by: updates, deviation, times, rates, coverage.

    Example: evertwin kpi robot.toml --data monday.csv --changed 600
    """
    from evertwin.app.twin.twin_commands import show_kpi

    show_kpi(twin, data, changed, as_json)


@app.command()
def fit(
    twin: TwinFile,
    train: Annotated[
        list[Path] | None, typer.Option("--train", help="To learn from; else its own files." + PART)
    ] = None,
    test: Annotated[
        list[Path] | None, typer.Option("--test", help="Recording to be judged on; repeat." + PART)
    ] = None,
    as_json: AsJson = False,
    check: Check = False,
    workers: Workers = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep what is found as a version of the twin.")
    ] = False,
    beside: Annotated[
        Path | None, typer.Option(help="Twin file whose fit to the same is shown beside.")
    ] = None,
) -> None:
    """Tune the parameters on recordings and judge them on others; nothing goes live.

    Example: evertwin fit arm.toml --train a.csv --train b.csv@0:60 --test b.csv@60:90
    """
    from evertwin.app.twin.twin_commands import fit_twin

    fit_twin(twin, (train or [], test or []), (as_json, check, keep), workers, beside)


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="Recording, or twin file.", metavar="FILE")],
    as_json: AsJson = False,
    check: Check = False,
    picture: Annotated[
        Path | None, typer.Option(help="PNG to write: some of its images, or scans.")
    ] = None,
) -> None:
    """What a recording (channels, rates, gaps, absurd values, truncated rows) or a twin file holds.

    Example: evertwin info run.csv
    """
    from evertwin.app.first.info_command import show_info

    show_info(file, as_json, check, picture)


@app.command()
def init(
    files: Annotated[
        list[Path],
        typer.Argument(help="Recordings; or a site file: its machine is read.", metavar="FILE..."),
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Twin file to write; else FILE.toml, here.")
    ] = None,
    model: Annotated[str, typer.Option(help=KINDS)] = "",
    urdf: Annotated[Path | None, typer.Option(help="Description of an arm.")] = None,
    namespace: Annotated[
        str, typer.Option(help="Of the topics of one machine, such as /robot1.")
    ] = "",
    answer: Annotated[
        list[str] | None,
        typer.Option(
            help="To what it asks: log.rate='100 Hz', u.column=pump, torque.scale=0.1; list "
            "several. What is proposed rests on it, unlike on an answer in the file."
        ),
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="For which the machine of a site file is read: let it move.")
    ] = 30.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Propose a commented twin file for recordings; of a series that tells wear: its command.

    Example: evertwin init run.csv --model robot1d -o robot.toml
    """
    from evertwin.app.first.doctor_site import is_site
    from evertwin.app.first.init_command import Said, write_for_site, write_starter

    said = Said(namespace, answer or ())
    if len(files) == 1 and is_site(files[0]):
        write_for_site(files[0], seconds, (out, force), (model, urdf), as_json, said)
    else:
        write_starter(files, out, (model, urdf), force, as_json, said)


@app.command()
def doctor(
    twin: TwinFile,
    data: DataFiles = None,
    every: Annotated[
        bool, typer.Option("--all", help="Every finding, not the first five.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Find what is wrong, or will be: units, lag, excitation, what is not identifiable.

    What spoils the result most comes first. Exit code 1 when there are findings. Of a site file:
    what its machines say now: registers in the likely types, topics, the tree of a server.

    Example: evertwin doctor robot.toml --data run.csv
    """
    from evertwin.app.twin.twin_commands import examine

    examine(twin, data, every, as_json)


@app.command()
def compare(
    twin: TwinFile,
    first: Number,
    second: Number,
    data: DataFiles = None,
    as_json: AsJson = False,
) -> None:
    """Two versions of a twin over the same data.

    Example: evertwin compare robot.toml 0 1 --data tuesday.csv
    """
    from evertwin.app.twin.twin_commands import compare_versions

    compare_versions(twin, (first, second), data, as_json)


@app.command()
def schema(
    breakdown: Annotated[bool, typer.Option("--breakdown", help="Of a breakdown file.")] = False,
    scenario: Annotated[bool, typer.Option("--scenario", help="Of a scenario file.")] = False,
    site: Annotated[bool, typer.Option("--site", help="Of a site file.")] = False,
    as_json: AsJson = False,
) -> None:
    """The JSON schema of the twin file, or of a breakdown, scenario or site file.

    Example: evertwin schema > evertwin.schema.json
    """
    from evertwin.app.schema_command import show_schema

    chosen = {"breakdown": breakdown, "scenario": scenario, "site": site}
    show_schema(next((name for name, on in chosen.items() if on), "twin"), as_json)


for part in (cli_outlook, cli_twin, cli_store, cli_map, cli_features, cli_site):
    app.registered_commands += part.app.registered_commands
for group in (
    cli_model.model_app, cli_store.store_app, cli_machine.machine_app, cli_site.fleet_app,
    cli_site.ros_app,
):  # fmt: skip
    app.add_typer(group)


@cache
def _built() -> Callable[..., Any]:
    """All commands, once in a process: reading what each takes is 30 ms."""
    return typer.main.get_command(app)


def main(arguments: list[str] | None = None) -> None:
    """Runs a command and exits with its code: 0 ok, 1 findings, 2 usage or configuration, 4 data,
    5 model, 75 locked, 101 bug, 130 interrupted."""
    words = sys.argv[1:] if arguments is None else arguments
    # threads of linear algebra spin for 2ⁿ ticks before they sleep: for 0.1 s of each command
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "20")
    try:
        run = _built()
        code = run(_spread(words) or ["--help"], standalone_mode=False, prog_name="evertwin")
        sys.stdout.flush()
        sys.exit(code if isinstance(code, int) else 0)
    except EvertwinError as error:
        _fail(str(error), error.exit_code, words)
    except (KeyboardInterrupt, typer.Abort):
        _fail("interrupted", 130, words)
    except BrokenPipeError:
        # the reader has left (| head): nothing more to say, and nothing to flush at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except Exception as error:  # noqa: BLE001  (the edge: typer's own errors and bugs end here)
        shown = getattr(error, "format_message", None)
        if shown is not None and getattr(error, "exit_code", None) is not None:
            if type(error).__name__ == "NoArgsIsHelpError":
                typer.echo(shown(), err=True)
                sys.exit(2)
            said = shown() + _belongs(error)
            _fail(f"{said}\nsee: evertwin {_command(error)}--help", 2, words)
        _bug(error, words)


def _belongs(error: Exception) -> str:
    """By what option files are named, where one more stands alone."""
    command = getattr(getattr(error, "ctx", None), "command", None)
    options = {name for one in getattr(command, "params", ()) for name in one.opts}
    named = [name for name in ("--data", "--train", "--test") if name in options]
    alone = "extra argument" in str(error) and bool(named)
    return f"; recordings are named by {' and '.join(named)}" if alone else ""


def _command(error: Exception) -> str:
    """The words of the command that a usage error is about, with a blank behind."""
    context = getattr(error, "ctx", None)
    path = "" if context is None else str(context.command_path).removeprefix("evertwin").strip()
    return f"{path} " if path else ""


def _spread(words: list[str]) -> list[str]:
    """``--data A B C`` is ``--data A --data B --data C``; so with all that takes several."""
    out: list[str] = []
    option = ""
    for word in words:
        if word in ("--data", "--train", "--test", "--fleet", "--failed", "--answer"):
            option = word
            continue
        if word.startswith("-") and len(word) > 1:
            option = ""
        out += [option, word] if option else [word]
    return out


def _fail(message: str, code: int, words: Sequence[str]) -> None:
    """What went wrong, on stderr; with ``--json`` among the command's words the document too."""
    if "--json" in words:
        typer.echo(json.dumps({"schema": "evertwin.error/1", "error": message, "code": code}))
    lines = message.splitlines()
    for line in lines[:MOST]:
        typer.echo(f"evertwin: {line if len(line) <= LONGEST else f'{line[:LONGEST]} …'}", err=True)
    if len(lines) > MOST:
        typer.echo(f"evertwin: … and {len(lines) - MOST} more", err=True)
    sys.exit(code)


def _bug(error: Exception, words: Sequence[str]) -> None:
    import traceback

    typer.echo("".join(traceback.format_exception(error)), err=True)
    _fail(f"this is a bug in evertwin: {type(error).__name__}: {error}", 101, words)


if __name__ == "__main__":
    main()
