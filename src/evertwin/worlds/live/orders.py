"""What a running machine can be told: ``payload=2 friction.3=1.3 for=20``.

An order is a knob, for some knobs what it is about (an axis, a signal, a cable) after a dot, and a
number. ``for=SECONDS`` among them takes the others back after so long, by the machine's clock.

>>> knobs = Knobs({"payload": Knob("mass at the tool [kg]", 0.0, 20.0),
...                "friction": Knob("factor", 0.1, 10.0, 1.0, ("1", "2"))})
>>> knobs.tell("payload=2 friction=1.3 for=5", now=0.0)
'payload=2 friction.1=1.3 friction.2=1.3'
>>> knobs.all("friction"), knobs.of("payload")
((1.3, 1.3), 2.0)
>>> knobs.tick(5.0)
>>> knobs.all("friction"), knobs.of("payload")
((1.0, 1.0), 0.0)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from evertwin.errors import UsageError, nearest


@dataclass(frozen=True)
class Knob:
    """One thing that can be changed, its range, and where it stands at first.

    >>> Knob("mass at the tool [kg]", 0.0, 20.0).neutral
    0.0
    """

    says: str
    """What it does, with the unit in square brackets."""
    low: float = -1e6
    high: float = 1e6
    neutral: float = 0.0
    about: tuple[str, ...] = ()
    """Axes, signals or cables; without one of them an order is about all."""
    lasts: float = math.inf
    """It is taken back after so long unless the order says ``for=`` [s]."""


@dataclass
class Knobs:
    """Where all knobs stand. See the module for an example."""

    known: Mapping[str, Knob]
    _values: dict[tuple[str, str], float] = field(default_factory=dict)
    _until: dict[tuple[str, str], float] = field(default_factory=dict)

    def of(self, name: str, about: str = "") -> float:
        """Where a knob stands."""
        return self._values.get((name, about), self.known[name].neutral)

    def all(self, name: str) -> tuple[float, ...]:
        """Where a knob stands for all that it is about."""
        return tuple(self.of(name, about) for about in self.known[name].about)

    def set(self, name: str, about: str, value: float) -> None:
        """The machine itself turns a knob: wear grows, a spike is over."""
        self._values[name, about] = value

    def turned(self) -> dict[str, float]:
        """What does not stand where it stood at first."""
        return {
            f"{name}.{about}" if about else name: value
            for (name, about), value in sorted(self._values.items())
            if value != self.known[name].neutral
        }

    def tick(self, now: float) -> None:
        """Takes back what has lasted long enough; ``now``: seconds of the machine's clock."""
        for key in [key for key, until in self._until.items() if now >= until]:
            del self._until[key]
            self._values.pop(key, None)

    def tell(self, line: str, now: float) -> str:
        """Follows one line of orders, all or none; returns what was done.

        Raises:
            UsageError: something in it is not known, or out of its range; nothing was done.
        """
        words = dict(_word(word) for word in line.split())
        lasts = words.pop("for", None)
        if not words:
            raise UsageError(f"expected orders such as payload=2, got {line.strip()!r}")
        if lasts is not None and not lasts > 0:
            raise UsageError(f"for: expected seconds above 0, got {lasts:g}")
        done = [(key, value) for word, value in words.items() for key in self._keys(word, value)]
        for key, value in done:
            self._values[key] = value
            until = now + (self.known[key[0]].lasts if lasts is None else lasts)
            self._until[key] = until
        return " ".join(f"{name}{'.' * bool(at)}{at}={value:g}" for (name, at), value in done)

    def _keys(self, word: str, value: float) -> Iterator[tuple[str, str]]:
        name, _, about = word.partition(".")
        knob = self.known.get(name)
        if knob is None:
            raise UsageError(f"this machine does not know {name!r}; {nearest(name, self.known)}")
        if about and about not in knob.about:
            there = ", ".join(knob.about) or "nothing after a dot"
            raise UsageError(f"{word}: expected {there}, got {about!r}")
        if not knob.low <= value <= knob.high:
            raise UsageError(f"{word}: expected {knob.low:g} to {knob.high:g}, got {value:g}")
        yield from ((name, one) for one in ((about,) if about else knob.about or ("",)))

    def __str__(self) -> str:
        """All knobs, a line each."""
        return "\n".join(
            f"{name}{'.' * bool(knob.about)}{'|'.join(knob.about)}: {knob.says}, "
            f"{knob.low:g} to {knob.high:g}, at first {knob.neutral:g}"
            for name, knob in self.known.items()
        )


def _word(word: str) -> tuple[str, float]:
    """``payload=2``.

    Raises:
        UsageError: it has another form.
    """
    name, sign, text = word.partition("=")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not name or not sign or not math.isfinite(value):
        raise UsageError(f"expected NAME=NUMBER, such as payload=2, got {word!r}")
    return name, value
