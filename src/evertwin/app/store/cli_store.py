"""The commands ``evertwin store …`` and ``evertwin events``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from evertwin.app.options import AsJson, group

TwinFile = Annotated[
    Path, typer.Argument(help="Twin file (TOML), or a store (.db).", metavar="TWIN.toml")
]
Key = Annotated[
    Path | None, typer.Option("--key", help="File with a secret: signs the head (HMAC-SHA256).")
]
app = typer.Typer()
store_app = group("store", "What a twin keeps: its head, whether it is sound, a copy of it.")


@app.command()
def events(
    twin: TwinFile,
    kind: Annotated[str | None, typer.Option(help="Of one kind.")] = None,
    as_json: AsJson = False,
) -> None:
    """What was decided and said so far, in the order of the log.

    Example: evertwin events arm.toml --kind promoted
    """
    from evertwin.app.store.store_commands import show_events

    show_events(twin, kind, as_json)


@store_app.command("head")
def head(twin: TwinFile, key: Key = None, as_json: AsJson = False) -> None:
    """Where the log ends, as LENGTH:HASH: written down elsewhere, it tells a rewritten log.

    Example: evertwin store head arm.toml --key secret.key >> heads.txt
    """
    from evertwin.app.store.store_commands import show_head

    show_head(twin, key, as_json)


@store_app.command("verify")
def verify(
    twin: TwinFile,
    head: Annotated[
        str | None, typer.Option("--head", help="LENGTH:HASH that was printed.")
    ] = None,
    key: Key = None,
    as_json: AsJson = False,
) -> None:
    """Verify every entry, state and sample against its hash, and the log against a printed head.

    Example: evertwin store verify arm.toml --head 812:3f0c…
    """
    from evertwin.app.store.store_commands import verify_store

    verify_store(twin, head, key, as_json)


@store_app.command("recover")
def recover(twin: TwinFile, as_json: AsJson = False) -> None:
    """Start a damaged store from what is sound; the damaged file is kept beside it."""
    from evertwin.app.store.store_commands import recover_store

    recover_store(twin, as_json)


@store_app.command("backup")
def backup(
    twin: TwinFile,
    file: Annotated[Path, typer.Argument(help="File to write.", metavar="FILE")],
    as_json: AsJson = False,
) -> None:
    """Write a copy of the store, while a twin may be at work with it.

    Example: evertwin store backup arm.toml arm-monday.db
    """
    from evertwin.app.store.store_commands import back_up

    back_up(twin, file, as_json)


@store_app.command("restore")
def restore(
    twin: TwinFile,
    file: Annotated[Path, typer.Argument(help="Backup.", metavar="FILE")],
    as_json: AsJson = False,
) -> None:
    """Put a backup in the place of the store; what stood there is kept as FILE.before.

    Example: evertwin store restore arm.toml arm-monday.db
    """
    from evertwin.app.store.store_commands import put_back

    put_back(twin, file, as_json)


@store_app.command("export")
def export(
    twin: TwinFile,
    file: Annotated[
        Path, typer.Argument(help="File to write: .csv, .mcap, .parquet, .npz.", metavar="FILE")
    ],
    source: Annotated[str, typer.Option(help="Of one source; only MCAP holds several.")] = "",
    store: Annotated[
        Path | None, typer.Option(help="Store of the service, in place of the twin file's.")
    ] = None,
    first: Annotated[float, typer.Option(help="Stamped from here on [s].")] = -math.inf,
    last: Annotated[float, typer.Option(help="Stamped up to here [s].")] = math.inf,
    as_json: AsJson = False,
) -> None:
    """Write the samples that a live twin has kept, in SI units, sorted by their stamps.

    Example: evertwin store export arm.toml monday.mcap --store store/arm.db
    """
    from evertwin.app.store.store_commands import export_samples

    export_samples(twin, file, (source, store), (first, last), as_json)
