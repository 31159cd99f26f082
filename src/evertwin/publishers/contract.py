"""The contract of a publisher, and what it is given.

A publisher only tells: it has no way to a machine, and nothing that comes back but questions.

>>> News("robot", "rows", {"row": [1]}).kind
'rows'
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, Self, TypeAlias

from evertwin.settings.section import Section

Kind: TypeAlias = Literal["whatif", "forecast", "life"]
Told: TypeAlias = Literal["rows", "events", "health", "life"]
"""What a twin tells of."""
Ask: TypeAlias = "Callable[[Kind, Mapping[str, Any]], Awaitable[Mapping[str, Any]]]"
"""A question: a scenario's table, ``{"horizon": seconds}``, or nothing more; and its answer."""


@dataclass(frozen=True)
class About:
    """The twin that a publisher speaks for.

    >>> About("robot", (("x", "m"),)).scene["kind"]
    'none'
    """

    name: str
    outputs: Sequence[tuple[str, str]]
    """Names and units of what it predicts."""
    scene: Mapping[str, Any] = field(default_factory=lambda: {"kind": "none"})
    """What its machine looks like: an arm's joints, a base's pose."""


class News(NamedTuple):
    """Something that a twin says. See the module for an example."""

    twin: str
    kind: Told
    content: Mapping[str, Any]
    """Plain content: numbers, text, lists, no NaN."""


@dataclass(frozen=True)
class PublisherSettings(Section):
    """``[[twin.publisher]]``: what every publisher is told; each protocol adds its own.

    >>> PublisherSettings("mqtt").protocol
    'mqtt'
    """

    protocol: str
    """How it speaks: mqtt, opcua or ros."""

    files: ClassVar[tuple[str, ...]] = ()
    """Those that name files or folders."""

    def at(self, folder: Path) -> Self:
        """The same with paths relative to ``folder``."""
        named = {name: getattr(self, name) for name in self.files}
        return replace(self, **{name: str(folder / text) for name, text in named.items() if text})


class Publisher(Protocol):
    """Tells what a twin says. All calls from the thread of the event loop; none blocks.

    >>> hasattr(Publisher, "publish")
    True
    """

    def open(self) -> None:
        """Begin to connect.

        Raises:
            MissingExtra: the library of the protocol is not installed.
        """
        ...

    def publish(self, news: News) -> None:
        """Something new; dropped and counted where the line is down or slow."""
        ...

    @property
    def health(self) -> Mapping[str, Any]:
        """State, counts of what was sent and dropped, newest reason."""
        ...

    async def close(self) -> None:
        """Say goodbye and let go. May be called again."""
        ...
