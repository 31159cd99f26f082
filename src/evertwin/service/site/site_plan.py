"""What a site file comes to: each twin with the settings of its sources and publishers.

What is wrong in the site file itself is an error with its line. A twin file that cannot be read
concerns its twin alone, which is told in `Plan.wrong`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from evertwin.config import TwinSpec, read
from evertwin.errors import ConfigError, UsageError, nearest
from evertwin.machines.catalog import contents
from evertwin.publishers import registry as publishers
from evertwin.publishers.contract import PublisherSettings
from evertwin.service.site.site_spec import NAME, SITE, SiteSpec, TwinEntry
from evertwin.settings.decode import decode
from evertwin.settings.document import Document
from evertwin.settings.notes import Path as Place
from evertwin.settings.section import Section
from evertwin.sources.live import registry as sources
from evertwin.sources.live.contract import LiveSettings
from evertwin.sources.live.mqtt.spec import MqttSettings

S = TypeVar("S", bound=Section)


@dataclass(frozen=True)
class Plan:
    """One twin as the site file has it.

    >>> Plan("arm", TwinEntry("arm.toml"), Path("arm.toml"), None, (), (), "no such file").wrong
    'no such file'
    """

    name: str
    entry: TwinEntry
    file: Path
    spec: TwinSpec | None
    """What the twin file says; None where it cannot be read."""
    sources: tuple[LiveSettings, ...]
    publishers: tuple[PublisherSettings, ...]
    wrong: str = ""
    """Why it cannot run."""


@dataclass(frozen=True)
class Site:
    """A site file and its twins.

    >>> Site(Path("hall/site.toml"), SiteSpec("hall"), ()).store.as_posix()
    'hall/store'
    """

    file: Path
    spec: SiteSpec
    twins: tuple[Plan, ...]

    @property
    def folder(self) -> Path:
        """What its paths are relative to."""
        return self.file.parent

    @property
    def store(self) -> Path:
        """The folder of the stores."""
        return self.folder / self.spec.store


def read_site(path: str | Path) -> Site:
    """The site file at ``path``, and the twin files that it names.

    Raises:
        ConfigError: the site file does not say what it must; one line for each problem.
    """
    file = Path(path).resolve()
    document = SITE.document(SITE.load(file), str(path))
    spec = decode(SITE.root, document)
    plans = [_plan(file.parent, entry, document, k) for k, entry in enumerate(spec.twin)]
    for k, plan in enumerate(plans):
        if plan.name in (other.name for other in plans[:k]):
            raise ConfigError(
                f"{document.name}:{document.line(('twin', k))}: twin {plan.name!r} is there twice: "
                "give one of them another name"
            )
    return Site(file, spec, tuple(map(_shared, plans)) if spec.fleet.store else tuple(plans))


def _shared(plan: Plan) -> Plan:
    """A twin that moves keeps its names at brokers: the next owner gets what the last one left."""
    sources = tuple(
        dataclasses.replace(one, client=one.client or f"evertwin-{plan.name}-{one.source}")
        if isinstance(one, MqttSettings) else one for one in plan.sources
    )  # fmt: skip
    return dataclasses.replace(plan, sources=sources)


def _plan(folder: Path, entry: TwinEntry, document: Document, k: int) -> Plan:
    told = tuple(
        _decoded(document, ("twin", k, "source", i), table, sources.settings_of)
        for i, table in enumerate(entry.source)
    )
    out = tuple(
        _decoded(document, ("twin", k, "publisher", i), table, publishers.settings_of).at(folder)
        for i, table in enumerate(entry.publisher)
    )
    file, wrong, spec = folder / entry.file, "", None
    try:
        spec = read(file)
    except UsageError as error:
        wrong = str(error)
    name = entry.name or (spec.name if spec is not None else file.stem)
    if not NAME.fullmatch(name):
        where = f"{document.name}:{document.line(('twin', k))}"
        raise ConfigError(
            f"{where}: twin {name!r}: expected letters, digits, - _ and dots: give it a name here"
        )
    known = [] if spec is None else [one.name for one in spec.source + spec.array]
    for i, one in enumerate(told):
        if spec is not None and one.source not in known:
            where = f"{document.name}:{document.line(('twin', k, 'source', i, 'source'))}"
            said = f"the twin file has no source {one.source!r}; {nearest(one.source, known)}"
            raise ConfigError(f"{where}: {said}")
    if spec is not None:
        of_files = contents(spec.folder, spec.model.options)
        spec = dataclasses.replace(spec, name=name, contents=of_files)
    return Plan(name, entry, file, spec, told, out, wrong)


def _decoded(
    document: Document, path: Place, table: Mapping[str, Any], form: Callable[[str], type[S]]
) -> S:
    """The settings of a table, in the form that its protocol has."""
    if not isinstance(table.get("protocol"), str):
        where = f"{document.name}:{document.line(path)}"
        raise ConfigError(f"{where}: needs 'protocol': how the other side speaks")
    try:
        kind = form(str(table["protocol"]))
    except UsageError as error:
        raise ConfigError(
            f"{document.name}:{document.line((*path, 'protocol'))}: {error}"
        ) from error
    return decode(kind, document.part(path))
