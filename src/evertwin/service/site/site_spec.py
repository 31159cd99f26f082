"""What a site file says: which twins run beside which machines, and how they are reached.

>>> text = 'schema = 1\\nname = "hall"\\n[[twin]]\\nfile = "arm.toml"\\nsorce = []'
>>> SITE.parse(text, "site.toml")
Traceback (most recent call last):
evertwin.errors.ConfigError: site.toml:5: [twin[0]] unknown key 'sorce', did you mean 'source'?
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from annotated_types import Ge, Gt, Le
from pydantic_core import CoreSchema, core_schema

from evertwin.errors import UsageError
from evertwin.fleet import FleetSpec
from evertwin.publishers import registry as publishers
from evertwin.settings.form import Form
from evertwin.settings.kinds import Duration
from evertwin.settings.section import Section
from evertwin.sources.live import registry as sources

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""A name that may be part of a file's name and of an address."""


@dataclass(frozen=True)
class Spoken:
    """A table whose form follows from its ``protocol``; read as it is, and by its own form later.

    >>> Spoken(sources.settings_of, ("replay",)).known
    ('replay',)
    """

    form: Callable[[str], type[Section]]
    known: tuple[str, ...]

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        forms: list[CoreSchema | tuple[CoreSchema, str]] = [
            handler.generate_schema(self.form(name)) for name in self.known
        ]
        return core_schema.json_or_python_schema(
            json_schema=core_schema.union_schema(forms), python_schema=core_schema.dict_schema()
        )


Table: TypeAlias = Mapping[str, Any]
SourceTable: TypeAlias = Annotated[Table, Spoken(sources.settings_of, tuple(sources.OWN))]
PublisherTable: TypeAlias = Annotated[Table, Spoken(publishers.settings_of, tuple(publishers.OWN))]
Role: TypeAlias = Literal["read", "operate"]


@dataclass(frozen=True)
class UserSpec(Section):
    """``[[http.user]]``: who may ask. ``evertwin token`` makes a token and its hash.

    >>> UserSpec("anna", "0" * 64).role
    'read'
    """

    name: str
    """Stands in the log of what was ordered."""
    hash: str
    """SHA-256 of the user's token, 64 digits."""
    role: Role = "read"
    """``operate``: may also promote, roll back, pin, reload."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not re.fullmatch(r"[0-9a-f]{64}", self.hash):
            raise UsageError("hash: expected 64 digits 0-9 a-f: make one with evertwin token")


@dataclass(frozen=True)
class HttpSpec(Section):
    """``[http]``: where the service is reached. Beyond this machine only with TLS and users.

    >>> HttpSpec().address
    '127.0.0.1'
    """

    address: str = "127.0.0.1"
    """IP address that the service listens at."""
    port: Annotated[int, Ge(0), Le(65535)] = 8700
    """0: any free one."""
    hosts: tuple[str, ...] = ()
    """Names that requests may call the service by, beside its address and localhost."""
    origins: tuple[str, ...] = ()
    """Origins of web pages that may ask, as in "https://panel.example"; its own always may."""
    certificate: str = ""
    """File with the certificate (PEM); relative to the site file."""
    key: str = ""
    """File with its key."""
    user: tuple[UserSpec, ...] = ()
    """Users; absent: whoever has the token in the file ``token`` of the store folder."""
    body: Annotated[int, Ge(1), Le(100_000_000)] = 65_536
    """Bytes of the largest question."""
    rate: Annotated[float, Gt(0.0)] = 50.0
    """Requests a second that one address may make for long; four times as many at once."""
    timeout: Duration = 10.0
    """A request that has not come whole after so long is given up."""
    connections: Annotated[int, Ge(1)] = 200
    """Connections at the same time; one address has half of them at most."""

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            here = ipaddress.ip_address(self.address).is_loopback
        except ValueError as error:
            raise UsageError(f"address: expected an IP address, got {self.address!r}") from error
        if bool(self.certificate) != bool(self.key):
            raise UsageError("expected both certificate and key, or neither")
        if not here and not (self.certificate and self.user):
            raise UsageError(
                f"address: {self.address} is reached from other machines: expected certificate, "
                "key and at least one [[http.user]]"
            )


@dataclass(frozen=True)
class TwinEntry(Section):
    """``[[twin]]``: one twin and its machine.

    >>> TwinEntry("arm.toml").full
    'wait'
    """

    file: str
    """Twin file; relative to the site file."""
    name: str = ""
    """Letters, digits, - _ and dots; absent: the twin file's."""
    source: tuple[SourceTable, ...] = ()
    """Where the columns of each ``[[source]]`` of the twin file come from."""
    publisher: tuple[PublisherTable, ...] = ()
    """Where it is told what the twin says."""
    queue: Annotated[int, Ge(1), Le(1_000_000)] = 256
    """Pieces of samples that wait at most to be stored, and as many to be folded."""
    full: Literal["wait", "drop"] = "wait"
    """What happens when so many wait: the sources wait, or the oldest piece is dropped and its
    samples are counted as lost."""
    workers: Annotated[int, Ge(0), Le(64)] | None = None
    """Processes of its own for slow work, in place of ``[engine] workers``; 0: samples wait for it.
    Absent, as in the twin file: those that all twins share."""
    days: Annotated[int, Ge(1)] | None = None
    """Whole days of samples (UTC, by their stamps) that stay in the store. Each older day goes to
    one Parquet file a source in the folder ``NAME.db.days`` beside it, whose hash the log keeps; it
    is read back as if it had stayed. Absent: all stay."""
    node: str = ""
    """The one node of a ``[fleet]`` that can run it, because its machine hangs on a line there;
    absent: any."""
    stale: Duration | None = None
    """Silence after which what is shown is stale; absent: three times the usual time between
    samples, at least a second."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name and not NAME.fullmatch(self.name):
            raise UsageError(f"name: expected letters, digits, - _ and dots, got {self.name!r}")


@dataclass(frozen=True)
class SiteSpec(Section):
    """A whole site file.

    >>> SiteSpec("hall").store
    'store'
    """

    name: str
    """Name of the site."""
    schema: int = 1
    """Version of the file's form."""
    store: str = "store"
    """Folder with one store a twin, and the token; relative to the site file."""
    warm: bool | Literal["beside"] = True
    """Compile what each twin needs before the service says that it is ready; `"beside"`: while the
    twins run already, slower, in a process of its own; false: where it pays, as rows come."""
    workers: Annotated[int, Ge(1), Le(64)] | None = None
    """Processes that twins share for slow work, from the next start on; absent: one a core."""
    http: HttpSpec = HttpSpec()
    """Where the service is reached."""
    fleet: FleetSpec = FleetSpec()
    """Several machines share the twins."""
    twin: tuple[TwinEntry, ...] = ()
    """The twins."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for one in self.twin:
            if self.fleet.store and one.days is not None:
                raise UsageError(
                    "days: files of a node's disk: a fleet keeps its samples on the server, one "
                    "partition a day: leave days out"
                )


_ABOUT = """# The site file

A site file is TOML and says which twins `evertwin serve` runs: each twin file as it is for
recordings, and where the columns of its sources come from. Quantities, patterns and `${NAME}` are
as in the [twin file](twin-file.md).

The JSON schema for editors comes from `evertwin schema --site`.
"""

SITE = Form(SiteSpec, 1, "site file", _ABOUT)
"""How site files are read."""
