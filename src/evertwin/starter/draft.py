"""The text of a first twin file.

Nothing is invented: a channel without a column gets the column ``"?"``, a number that nobody said
the value ``"?"``, rows without a time the rate ``"?"``, which a run refuses by name.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.models import Model
from evertwin.models.contract import is_adopted
from evertwin.settings.writing import inline, template
from evertwin.signals import conversion
from evertwin.starter.channels.named import short
from evertwin.starter.feeding import Source
from evertwin.starter.looks.seen import Seen
from evertwin.starter.looks.words import quantity, same_kind, words
from evertwin.starter.numbers.cutoff import cutoff
from evertwin.starter.numbers.foretold import Answer, answer_of, buried, moved
from evertwin.starter.numbers.lagging import time_constant
from evertwin.starter.numbers.payload import acting
from evertwin.starter.numbers.speeds import fastest, of_joints
from evertwin.starter.numbers.starts import Own, own_of, starts_of
from evertwin.starter.numbers.untaken import untaken
from evertwin.starter.numbers.wear import at_usual_speed
from evertwin.starter.options import stands_in
from evertwin.starter.proposal import ASK, Proposal, position

NAMED = 3
"""Recordings that are named in the first line."""
EFFORTS = {"force", "torque"}
POSED = ("bicycle", "differential", "omni")
"""Bases whose pose in the plane is told."""
TRIED = 100
"""Predictions that a recording has room for: those that tell of a deviation, and those of a
trial."""
FASTEST = 500.0
"""Rows per second that a static map is resampled to at most: motion is slower."""
EXACT = 1e-6
"""So near to three digits a period is that of a clock, and no mean of uneven ones."""


@dataclass(frozen=True)
class Draft:
    """All that the text is made of.

    >>> Draft.__name__
    'Draft'
    """

    out: Path
    kind: str
    options: Mapping[str, Any]
    model: Model | None
    seen: tuple[Seen, ...]
    proposal: Proposal
    reach: float = 0.0
    """What noise and rows that are far apart make of such predictions [SI]; 0: it is not known."""
    measured: tuple[str, ...] = ()
    """Inputs whose rows say what they were, not what they are told to be until the next one."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """The tables that a channel is taken from; the first where none is."""
        used = sorted({match.source for match in self.proposal.matches}) or [0]
        names = _distinct([short(self.seen[s].about) for s in used]) if len(used) > 1 else ["log"]
        names = [self.seen[s].source or name for s, name in zip(used, names, strict=True)]
        here = self.out.resolve().parent
        return tuple(
            Source(
                name, tuple(os.path.relpath(f.resolve(), here) for f in self.seen[s].files),
                _pattern(self.seen[s]) if self._apart(used) else "", self.seen[s].table.time,
                self.seen[s].period, tuple(m for m in self.proposal.matches if m.source == s),
                self._held(s), self.seen[s].task, self.seen[s].every is not None,
            )
            for name, s in zip(names, used, strict=True)
        )  # fmt: skip

    def _held(self, source: int) -> bool:
        """Does a table give inputs alone, by rows that come as they change, or say nothing new?"""
        found = [m for m in self.proposal.matches if m.source == source]
        inputs = () if self.model is None else self.model.inputs.names
        own = found and all(m.channel in inputs for m in found)
        return bool(own and self.seen[source].holds([m.column for m in found if m.column != ASK]))

    def _apart(self, used: Sequence[int]) -> bool:
        return len({self.seen[s].files for s in used}) > 1

    @property
    def _origin(self) -> str:
        """The recordings, the first of many and their number."""
        names = list(dict.fromkeys(file.name for one in self.seen for file in one.files))
        more = f" … {names[-1]} ({len(names)} files)" if len(names) > NAMED else ""
        return ", ".join(names[:NAMED]) + more

    @property
    def static(self) -> bool:
        """Is it a map from motion to force?"""
        return self.model is not None and len(self.model.states) == 0

    @property
    def forced(self) -> int:
        """Channels for which a column has to be in another unit than SI, though nobody says so, or
        to be another effort than its heading says."""
        columns = {(s, c.name): c.unit for s, one in enumerate(self.seen) for c in one.columns}
        return sum(
            (columns.get((m.source, m.column)) == "" and conversion(m.unit)[0] != 1.0)
            + (quantity(words(m.column)) in EFFORTS - {m.channel} and m.channel in EFFORTS)
            for m in self.proposal.matches
        )

    @property
    def period(self) -> float | None:
        """Seconds from row to row, of the slowest source that does not hold what it says; None
        where one does not say it."""
        sources = [s for s in self.sources if not s.holds] or self.sources
        periods = [source.period for source in sources]
        known = [period for period in periods if period is not None]
        return max(known) if len(known) == len(periods) else None

    @property
    def rate(self) -> float | None:
        """Rate to resample to, where derivatives, a filter or several sources need one: of every
        row, or of every second, third … one where they come faster than motion needs."""
        if not (self.period and self.period > 0 and (self.static or len(self.sources) > 1)):
            return None
        exact = abs(float(f"{self.period:.3g}") / self.period - 1.0) < EXACT
        rate = float(f"{1.0 / self.period:.{6 if exact else 3}g}")
        return float(f"{rate / math.ceil(rate / FASTEST - EXACT):.6g}")

    @property
    def moving(self) -> dict[str, str]:
        """Effort of a static map → the speed of what it moves."""
        if not self.static or self.model is None:
            return {}
        if self.kind == "arm":
            return {f"tau{j}": f"qd{j}" for j in range(1, len(self.model.outputs) + 1)}
        return dict.fromkeys(self.model.outputs.names, "speed") if "drive" in self.kind else {}

    @property
    def above(self) -> float:
        """Speed [SI] from which on something moves: of an axis, a fiftieth of its usual fastest."""
        if self.kind == "arm":
            joints = range(1, len(self.moving) + 1)
            told = [fastest(self.proposal, self.seen, f"qd{j}", f"q{j}") for j in joints]
            return of_joints(told)
        found = fastest(self.proposal, self.seen, "speed", "position")
        return float(f"{0.02 * found:.1g}") if math.isfinite(found) else 0.0

    @property
    def horizon(self) -> float:
        """Of predictions [s]: a power of ten; ten rows or more where nothing is driven, and as many
        as what answers needs to move by far more than its noise. A recording with no room for a
        trial of such ones has shorter ones, but of what goes as far as it likes: so little of its
        way is noise."""
        rows = 10.0 * (self.period or 0.01) * (0.1 if self._base else 1.0)
        usual = max(1.0, float(f"{10 ** math.ceil(math.log10(rows)):g}"))
        if self.static or self._goes or not math.isfinite(self.duration):
            return usual
        room = max(_digit(self.duration / TRIED, math.floor), _digit(rows, math.ceil))
        values = self.answer.values
        while usual < room and buried(values, usual / (self.period or usual)):
            usual *= 10.0
        return min(usual, room)

    @property
    def duration(self) -> float:
        """Of the longest table [s]; infinite where neither stamps nor a rate say it."""
        period = self.period or math.inf
        return max(
            one.table.rows * period if one.table.time is None else one.table.time.duration
            for one in self.seen
        )

    @property
    def gap(self) -> float | None:
        """Longest interval that is simulated over [s]: a few lost rows are none. None: what is
        usual tells it, where a measurement gives the whole state."""
        if self.model is None or is_adopted(self.model):
            return None
        return max(10.0, float(f"{10.0 * (self.period or 0.0):.2g}"))

    @property
    def window(self) -> float:
        """What a deviation is judged on [s]: many predictions; a quarter of the recording."""
        many = (10.0 if self.static else 100.0) * self.horizon
        return float(f"{min(many, max(10.0 * self.horizon, self.duration / 4)):.2g}")

    @property
    def memory(self) -> float:
        """What is learned from [s]."""
        return (60.0 if self.static else 300.0) * self.horizon

    @property
    def judged(self) -> tuple[str, ...]:
        """Outputs that one requirement suits: those in the first one's unit, and headings."""
        outputs = () if self.model is None else tuple(self.model.outputs)
        alike = tuple(one.name for one in outputs if one.unit == outputs[0].unit)
        return alike + self.headings

    @property
    def shares(self) -> bool:
        """Are a machine's own outputs in several units, so that a share is asked of each?"""
        if self.model is None or self.kind != "python" or self.static:
            return False
        return len(set(self.model.outputs.units)) > 1

    @property
    def share_asked(self) -> float:
        """A round fiftieth of what outputs move in a prediction, as a share of their size, or what
        can be reached; of the output that needs most."""
        rows, least = round(self.horizon / (self.period or self.horizon)), 2.0 * self.reach
        for match in self.proposal.matches:
            if self.model is not None and match.channel in self.model.outputs.names:
                values = self.seen[match.source].values(match.column)
                warm = same_kind(match.unit, "K")
                size = np.nanmax(values) - np.nanmin(values) if warm else np.nanstd(values)
                size = size if warm else math.hypot(size, float(np.nanmean(values)))
                least = max(least, 0.02 * moved(values, rows) / size if size > 0.0 else 0.0)
        return _digit(max(least, 1e-6), math.ceil)

    @property
    def headings(self) -> tuple[str, ...]:
        """Angles of a base: judged as the way of a point 1 m ahead, so that 0.01 m is 0.01 rad."""
        if self.model is None or not self._base:
            return ()
        return tuple(one.name for one in self.model.outputs if one.kind == "angle")

    @property
    def spread(self) -> tuple[float, str]:
        """How far the first output that is judged moves in a prediction (of a static map: over all
        rows), without its rarest twentieths, and the unit; 0 where no column says it. A range tells
        little of a store that is slow, and nothing of what goes as far as it likes."""
        rows = 0 if self.static else round(self.horizon / (self.period or self.horizon))
        return moved(self.answer.values, rows), self.answer.unit

    @property
    def answer(self) -> Answer:
        """The first output that is judged."""
        names = self.judged if self.model is not None else ("y",)
        return answer_of(names, self.proposal.matches, self.seen)

    def share(self, part: float) -> str:
        """A round ``part`` of the spread as a twin file writes it; empty where it is not known."""
        size, unit = self.spread
        told = f"{float(f'{part * size:.1g}'):g} {unit}".removesuffix(" 1")
        return told if size > 0.0 else ""

    @property
    def asked(self) -> float:
        """A round fiftieth of the spread in SI, or what can be reached (with more room where nobody
        has said what the machine is); 0: neither is known."""
        room = 1.25 if self.static or self._goes else 2.0
        size, unit = self.spread
        usual = float(f"{0.02 * size * conversion(unit)[0]:.1g}") if size > 0.0 else 0.0
        return max(usual, _digit(room * self.reach, math.ceil)) if self.reach > 0.0 else usual

    @property
    def required(self) -> str:
        """The same as a twin file writes it; empty where it is not known."""
        size, unit = self.spread
        if not size > 0.0:
            return ""
        return f"{self.asked / conversion(unit)[0]:g} {unit}".removesuffix(" 1")

    @property
    def ladder(self) -> tuple[str, ...]:
        """Terms of a law that may stay out; the first is the one that every drive has."""
        return tuple(str(self.options.get("law", "")).split("+")[1:])

    @property
    def undescribed(self) -> bool:
        """Is it asked what the bodies of an arm are?"""
        return self.options.get("urdf") == ASK

    @property
    def once(self) -> tuple[str, ...]:
        """An arm's rotors and bodies stay once they are known, friction goes on."""
        names = self.model.parameters.names if self.model is not None else ()
        if self.kind != "arm" or self.undescribed:
            return ()
        links = dict.fromkeys(name.partition(".")[0] for name in names if "." in name)
        links.pop("payload", None)
        alike = bool(links) and all(link.endswith("_link") for link in links)
        bodies = ("*_link.*",) if alike else tuple(f"{link}.*" for link in links)
        return (*(("Ia*",) if "Ia1" in names else ()), *bodies)

    @property
    def rubs(self) -> tuple[str, ...]:
        """An arm's friction, as patterns of its names."""
        free = self.model.parameters.editable if self.model is not None and self.once else ()
        names = dict.fromkeys(name.rstrip("0123456789") for name in free if "." not in name)
        return tuple(f"{name}*" for name in names if name != "Ia")

    @property
    def corrected(self) -> tuple[str, ...]:
        """What a moving base, or a machine of one's own, is told: drives are rarely what they are
        taken for. A box may have walls, which take heat and give it back."""
        if self.model is None:
            return ("u",)
        if self.kind == "thermal":
            return (*self.model.inputs.names, *self.model.outputs.names)
        own = self.kind == "python" and not self.static
        return self.model.inputs.names if self._base or own else ()

    @property
    def untaken(self) -> tuple[tuple[str, ...], float]:
        """Columns that no channel takes and that tell what the taken ones leave, and how much."""
        linear = not (self._base or self.kind == "arm")  # enough for a column to be told
        rows = self.horizon / (self.period or self.horizon) if linear else 0.0
        return untaken(self.model, self.proposal, self.seen, self.judged or ("y",), rows)

    @property
    def terms(self) -> tuple[str, ...]:
        """Kinds of term that such corrections are sought among."""
        if self.kind == "thermal":
            return ("lag", "table", "law", "state")
        coupled = ("coupling",) if len(self.corrected) > 1 else ()
        posed = ("lever", "current") if self.kind in POSED else ()
        wheeled = ("wheels",) if self.kind in ("differential", "odometer") else ()
        base = ("direction", "hysteresis") if self._base else ()
        return ("lag", *coupled, *posed, *wheeled, "slew", *base, "table", "law")

    @cached_property
    def own(self) -> Own:
        """Where a model of one's own starts from."""
        return own_of(self.proposal.matches, self.seen)

    @property
    def _goes(self) -> bool:
        return self._base or self.kind == "drive"

    @property
    def _base(self) -> bool:
        return self.kind in (*POSED, "odometer", "robot1d")

    @property
    def questions(self) -> tuple[str, ...]:
        """What a person has to say before a run."""
        rates = (f"{s.name}: rate of the rows" for s in self.sources if s.period is None)
        options = (f"model: {name}" for name, said in self.options.items() if said == ASK)
        return (*options, *rates, *self.proposal.questions)

    def text(self) -> str:
        """The twin file."""
        model, here, options = self.model, self.out.resolve().parent, dict(self.options)
        if str(options.get("urdf", "")).endswith(".urdf"):
            options["urdf"] = os.path.relpath(Path(options["urdf"]).resolve(), here)
        names = self.own._fields if model is None else model.parameters.editable
        layout = () if model is None else (*model.inputs, *model.outputs)
        units = {channel.name: channel.unit for channel in layout}
        return template("starter", "starter.toml.txt", column=_column).render(
            draft=self, model=model, ask=ASK, units=units, stands_in=stands_in(self.options),
            payload=", ".join(acting(model)) if self.once and model is not None else "",
            starts=starts_of(model, self.proposal.matches, self.seen),
            options=", ".join(f"{k} = {inline(v)}" for k, v in options.items()),
            wears=at_usual_speed(model, self.proposal, self.seen) if self.once and model else (),
            lag=self.once and model and time_constant(model, self.proposal, self.seen, self.above),
            recordings=self._origin, editable=", ".join(map(inline, names[:6])),
            cutoff=cutoff(self.proposal, self.seen, self.rate) if self.rate and self.static else 0,
        )  # fmt: skip


def _digit(value: float, rounded: Callable[[float], int]) -> float:
    """Rounded to one digit."""
    power = math.floor(math.log10(value))
    return float(f"{rounded(round(value / 10.0**power, 6))}e{power}")


def _pattern(seen: Seen) -> str:
    """Of a source's files: their names with * for numbers."""
    return re.sub(r"\d+", "*", seen.files[0].name)


def _distinct(names: Sequence[str]) -> list[str]:
    return [name if name not in names[:i] else f"{name}_{i + 1}" for i, name in enumerate(names)]


def _column(name: str) -> str:
    return inline(position(name))
