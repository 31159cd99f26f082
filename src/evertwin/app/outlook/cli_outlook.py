"""The commands that look ahead: forecast, life, whatif, setpoint, plan, decide."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from evertwin.app.options import AsJson, Check, Reason, Report, TwinFile
from evertwin.errors import UsageError

app = typer.Typer()
DataFiles = Annotated[
    list[Path] | None,
    typer.Option("--data", help="Recordings in place of the twin file's; list several."),
]
History = Annotated[
    Path | None, typer.Option(help="History (CSV) in place of the store's parameter history.")
]


@app.command()
def forecast(
    twin: TwinFile,
    horizon: Annotated[
        str | None,
        typer.Option(help="How far, as in '10 min'. Default: 60 s, or to the end of --inputs."),
    ] = None,
    data: DataFiles = None,
    mode: Annotated[
        Literal["repeat", "hold"] | None,
        typer.Option("--as", help="Newest inputs again, or the last. Default: repeat."),
    ] = None,
    inputs: Annotated[
        Path | None,
        typer.Option(
            help="CSV with t [s] and the inputs to come: the recordings' columns, or channels in "
            "the units that they are recorded in, or in those of the headings."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """What the machine will do after its recordings: each output with its band.

    Example: evertwin forecast robot.toml --data run.csv --horizon "30 s"
    """
    from evertwin.app.outlook.outlook_commands import show_forecast

    show_forecast(twin, horizon, data, (mode, inputs), as_json)


@app.command()
def life(
    twin: Annotated[
        Path, typer.Argument(help="Twin file (TOML), or a series alone.", metavar="TWIN.toml|CSV")
    ],
    history: History = None,
    data: DataFiles = None,
    report: Report = None,
    limit: Annotated[
        str | None,
        typer.Option(help="Of a series alone: where its life ends, as in 1.4 or '0.3 mm'."),
    ] = None,
    below: Annotated[
        bool, typer.Option("--below", help="Of a series alone: the harmful side is below.")
    ] = False,
    column: Annotated[str, typer.Option(help="Of a series alone: the column of values.")] = "",
    fleet: Annotated[
        list[str] | None,
        typer.Option(
            help="Of a series alone: like machines, histories or stores, as in 'others/*.csv'."
        ),
    ] = None,
    failed: Annotated[
        list[str] | None,
        typer.Option(help="As --fleet; those that failed with their last row, limit or not."),
    ] = None,
    today: Annotated[
        bool,
        typer.Option(
            "--today", help="Where rows have dates: counted from today, if all still works."
        ),
    ] = False,
    as_json: AsJson = False,
    check: Check = False,
) -> None:
    """Remaining useful life of each component, from the parameter history or a file.

    Example: evertwin life arm.toml --history friction.csv
    Example: evertwin life cell.csv --limit 1.4 --below --fleet 'others/*.csv'
    """
    if twin.suffix.lower() != ".toml":
        from evertwin.app.outlook.life_of_series import show_series

        if history is not None or data:
            raise UsageError(
                f"{twin}: --history and --data are of a twin file (TOML); a series alone is the "
                "history itself"
            )
        told = (limit, below, column, today)
        show_series(twin, told, (fleet, failed), report, as_json, check)
        return
    if limit is not None or below or column or fleet or failed:
        raise UsageError(
            f"{twin}: --limit, --below, --column, --fleet and --failed are of a series alone; a "
            "twin file says them in [[indicator]] and [prognosis]"
        )
    from evertwin.app.outlook.outlook_commands import show_life

    show_life(twin, (history, data), (report, today), as_json, check)


@app.command()
def whatif(
    twin: TwinFile,
    scenario: Annotated[Path, typer.Option(help="Scenario file (TOML).", metavar="FILE")],
    data: DataFiles = None,
    history: History = None,
    as_json: AsJson = False,
    check: Check = False,
) -> None:
    """A scenario beside today: other speed, load, path, parameter, component, wear at a date.

    Example: evertwin whatif arm.toml --scenario faster.toml --data monday.csv
    """
    from evertwin.app.outlook.outlook_commands import show_whatif

    show_whatif(twin, scenario, (history, data), as_json, check)


@app.command()
def setpoint(
    twin: TwinFile,
    wanted: Annotated[
        list[str] | None, typer.Option(help="Speed that is wanted, as in '10 cm/s'; repeat.")
    ] = None,
    input_name: Annotated[
        str, typer.Option("--input", help="Input. Default: the one that moves the output most.")
    ] = "",
    output: Annotated[str, typer.Option(help="Output. Default: by the unit.")] = "",
    data: DataFiles = None,
    as_json: AsJson = False,
) -> None:
    """Which set-point gives the speed that is wanted, by the live version; or why none does.

    Example: evertwin setpoint robot.toml --wanted "10 cm/s" --data run.csv
    """
    from evertwin.app.outlook.setpoint_command import show_set_points

    show_set_points(twin, wanted or [], (input_name, output), data, as_json)


@app.command()
def plan(
    twin: TwinFile,
    history: History = None,
    data: DataFiles = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Write the plan as CSV.")] = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """The cheapest date of maintenance of each component.

    Example: evertwin plan arm.toml -o plan.csv
    """
    from evertwin.app.outlook.outlook_commands import show_plan

    show_plan(twin, (history, data), out, report, as_json)


@app.command()
def decide(
    twin: TwinFile,
    said: Annotated[
        tuple[str, str] | None,
        typer.Argument(
            help="Component; then confirm, postpone, reject, replaced, adjusted, failed or "
            "withdraw.",
            metavar="COMPONENT VERDICT",
        ),
    ] = None,
    when: Annotated[
        str | None,
        typer.Option(
            help="In units of [prognosis] clock. Confirm, postpone: from now, the newest value, as "
            "'after' in the plan. Replaced, adjusted: the moment itself, as in run 14; absent: "
            "now. Where rows have dates also a date, as in 2027-03-01."
        ),
    ] = None,
    reason: Reason = "",
    history: History = None,
    as_json: AsJson = False,
) -> None:
    """Say what becomes of a planned date, or what was maintained; kept in the store.

    Withdraw takes the newest word on a component back; both stay in the log. Without a component:
    lists what was said and done, and what of it counts.

    Example: evertwin decide arm.toml gearbox1 postpone --when 20 --reason "spare part late"
    Example: evertwin decide arm.toml gearbox1 replaced --reason "gearbox replaced"
    """
    from evertwin.app.outlook.outlook_commands import keep_decision, show_decisions

    if said is not None:
        keep_decision(twin, said, (reason, when), history, as_json)
    elif when is None and not reason:
        show_decisions(twin, as_json)
    else:
        raise UsageError("decide: expected a component and a verdict; alone it lists the past ones")
