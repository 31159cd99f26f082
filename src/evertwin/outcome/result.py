"""What a run found: figures before and after, events, the champion, and the rows themselves."""

from __future__ import annotations

import html
import math
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pkgutil import resolve_name
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from evertwin.errors import MissingExtra
from evertwin.fold import Event, interval, plain
from evertwin.models import Model, Parameters
from evertwin.models.form import Form, Version
from evertwin.models.functions.failures import Failed
from evertwin.outcome.course.spells import Spell
from evertwin.outcome.course.summed_up import Several, summed_up
from evertwin.outcome.not_counted import uncounted
from evertwin.outcome.open.on_trial import OpenTrial, shorter
from evertwin.outcome.shell import Shell
from evertwin.signals.spoken import MANY, both, percent, share, suited
from evertwin.sources.clocks.tally import Tally
from evertwin.types import Json

if TYPE_CHECKING:
    import pandas
    import xarray

DECISIONS = (
    "promoted", "rolled_back", "superseded", "corrected", "changed", "external", "recurring",
    "leapt", "not_judged", "state", "training_restarted", "model_failed", "pinned", "configured",
    "drift", "unknown", "alternates", "table_moved", "table_gone",
)  # fmt: skip
"""Kinds of event that a person reads first."""
DATED = 3 * 10**17
"""Stamps beyond this [ns] are dates: of a clock that began in 1970, since 1979."""
PICTURE = "evertwin.report.run_report:first_picture"
"""What draws; by its name, since it is above the ladder of imports and slow to load."""
MOST = 12
"""Of them, the newest that are shown at once."""


@dataclass(frozen=True)
class OutputFigures:
    """Deviation of one output by the first and by the last champion, over the same unseen rows.

    >>> OutputFigures("m", 2.0, 1.0, 0.2, 0.1, 0.2, 0.1, 100, 100, 1.0).rms_after
    1.0
    """

    unit: str
    rms_before: float
    rms_after: float
    relative_rms_before: float
    relative_rms_after: float
    relative_rms_moving_before: float
    relative_rms_moving_after: float
    rows: int
    moving: int
    judged: float = math.nan
    """What the requirement is compared with, of the last champion; NaN: it is not judged."""
    rms_moving_before: float = math.nan
    rms_moving_after: float = math.nan
    recorded: str = ""
    """The unit that the twin file gives, in which people are told of it."""
    most: float = math.nan
    """The most that a prediction was off by, apart from where measurements overruled it."""
    spell: Spell | None = None
    """Where it is off by more than is asked: the one stretch on which it was, if it fits again."""
    held: bool = False
    """Were all outputs within what is asked in the newest window that was judged, and none beyond
    what was calm?"""

    def __repr__(self) -> str:
        first, last = both(self.before, self.after, self.unit, self.recorded)
        return f"<OutputFigures: off by {first} before, {last} now, over {self.rows} rows>"

    @property
    def before(self) -> float:
        """Rms of the rows that move; of all where none does."""
        return self.rms_before if math.isnan(self.rms_moving_before) else self.rms_moving_before

    @property
    def size(self) -> float:
        """Rms of what was measured where it moved, by which a share is taken."""
        share = self.relative_rms_moving_after
        return self.rms_moving_after / share if share > 0.0 else math.nan

    @property
    def after(self) -> float:
        """The same, of the last champion."""
        return self.rms_after if math.isnan(self.rms_moving_after) else self.rms_moving_after

    @property
    def relative(self) -> float:
        """The same, by the rms of what was measured there."""
        moving = self.relative_rms_moving_after
        return self.relative_rms_after if math.isnan(moving) else moving


@dataclass(frozen=True)
class RunResult:
    """The outcome of `Twin.run`.

    >>> RunResult.__name__
    'RunResult'
    """

    name: str
    samples: int
    """Rows of the union clock."""
    seconds: float
    """Time that the run took [s]."""
    outputs: Mapping[str, OutputFigures]
    position_updates: tuple[int, int]
    """By the first and the last champion, over the same unseen rows."""
    unseen_since: int
    """Row from which these figures count: the last change of champion."""
    events: tuple[Event, ...]
    champion: Version
    parameters: Parameters
    """Of the champion, with its values."""
    knowledge: Mapping[str, Mapping[str, Any]]
    """Parameter → interval95 and verdict of its newest fit."""
    versions: tuple[Version, ...]
    model: Model
    """Of the champion."""
    models: Mapping[Form, Model] = field(repr=False)
    """Of every form that was live or tried."""
    trace: Mapping[str, np.ndarray] = field(repr=False)
    rounds: tuple[Mapping[str, Any], ...] = ()
    """Rounds of tuning by iteration: version, deviation per output, tried, frozen, values."""
    left_out: tuple[Tally, ...] = ()
    """What was wrong with the recordings, and the rows left out for it, by source."""
    passed: int = 0
    """Rows that were passed over: runs before had them."""
    began: int = 0
    """Row of the run that it went on from, after it was cut off or at its end."""
    trial: OpenTrial | None = None
    """The challenger that was on trial at the end."""
    local: bool = False
    """Are its dates those of a recording that names no zone?"""
    headline: str = ""
    """What came of it, as one would tell a colleague."""
    faults: Mapping[str, str] = field(default_factory=dict)
    """Signals whose measurement is in error at the end, or stands apart from the model, and how."""
    missed: tuple[str, ...] = ()
    """Outputs that are off by more than is asked, and not on one stretch alone that is over."""
    asked: Mapping[str, float] = field(default_factory=dict)
    """What each output that is judged may be off by, in its unit."""
    judged: bool = True
    """Was anything that moved held against what is asked, or a version by which to go on live?"""
    relative: bool = True
    """Are outputs held to a share of their size?"""
    pinned: bool = False
    """Is the champion kept live, whatever is found?"""
    failed: Failed | None = None
    """Rows that the model could not compute, its step having raised something; they count
    nowhere."""

    def __repr__(self) -> str:
        said = shorten(self.headline, 120, placeholder=" …")
        return f"<RunResult of {self.name!r}, version {self.champion.number}: {said}>"

    def __getstate__(self) -> dict[str, Any]:
        """What travels to another process: all but the models, of which channels and numbers do."""
        models = {form: Shell.of(model) for form, model in self.models.items()}
        return {**self.__dict__, "model": Shell.of(self.model), "models": models}

    @property
    def problems(self) -> Mapping[str, int]:
        """What was wrong with the recordings, counted over all sources."""
        return sum((Counter(tally.counts) for tally in self.left_out), Counter[str]())

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.run/1"``."""
        before, after = self.position_updates
        content: dict[str, Any] = {
            "schema": "evertwin.run/1",
            "name": self.name,
            "headline": self.headline,
            "samples": self.samples,
            "seconds": self.seconds,
            "unseen_since_row": self.unseen_since,
            "outputs": self.outputs,
            "position_updates": {"before": before, "after": after},
            "events": self.events,
            "champion": {
                "version": self.champion.number,
                "pinned": self.pinned,
                "hash": self.champion.hash,
                "terms": self.champion.form.terms,
                "variant": dict(self.champion.form.variant),
                "reason": self.champion.reason,
            },
            "trial": self.trial,
            "parameters": {item.name: self._parameter(item.name) for item in self.parameters},
            "data_problems": self.problems,
            "model_failed": self.failed and self.failed.to_dict(),
            "left_out": [tally.to_dict() for tally in self.left_out],
            "rounds": self.rounds,
        }
        return plain(content)  # type: ignore[return-value]

    def _parameter(self, name: str) -> dict[str, Any]:
        item, known = self.parameters[name], self.knowledge.get(name, {})
        # an interval belongs to the value it was found with: a fit that was not adopted has none
        mine = known.get("value") == item.value
        verdict = known.get("verdict", "not tuned")
        if verdict == "identifiable" and any(tally.doubt for tally in self.left_out):
            verdict = "weak"  # its rows' times may be in another unit
        return {
            "value": item.value,
            "unit": item.unit,
            "interval95": interval(known.get("interval95")) if mine else None,
            "verdict": verdict,
        }

    def model_of(self, version: Version) -> Model:
        """The model of one of the run's versions."""
        return self.models[version.form]

    def of_kind(self, *kinds: str) -> tuple[Event, ...]:
        """The events of some kinds, in order."""
        return tuple(event for event in self.events if event.kind in kinds)

    @property
    def every(self) -> int:
        """Of how many rows one is kept in ``trace``, `to_pandas` and `to_xarray`: 1 up to 100,000
        rows, then 2, 4, … (`evertwin.outcome.trace`). A part of a recording, ``FILE@START:STOP``,
        is kept whole; `Twin.blocks` has all measured rows."""
        row = self.trace.get("row", np.empty(0))
        return int(np.diff(row).min()) if len(row) > 1 else 1

    def _rows(self) -> Mapping[str, np.ndarray]:
        if self.every > 1:
            warnings.warn(
                f"{self.name}: one of {self.every} rows is kept, {len(self.trace['row'])} of "
                f"{self.samples}: RunResult.every says how to have more", stacklevel=3,
            )  # fmt: skip
        return self.trace

    def to_pandas(self) -> pandas.DataFrame:
        """The rows as a table: measured, predicted and residual per output, by time [s].

        Of more than 100,000 rows some: one of `every`, which is in its ``attrs``, too.

        Raises:
            MissingExtra: pandas is not installed.
        """
        try:
            import pandas
        except ModuleNotFoundError as error:
            raise MissingExtra.of("pandas", "analysis") from error
        columns, rows = dict[str, Any](), self._rows()
        for k, name in enumerate(self.model.outputs.names):
            for kind in ("measured", "predicted", "residual"):
                columns[f"{name}.{kind}"] = rows[kind][:, k]
        index = pandas.Index(rows["row"], name="row")
        table = pandas.DataFrame(columns, index=index)
        table.insert(0, "t", rows["t"] * 1e-9)
        table.attrs["every"] = self.every
        return table

    def to_xarray(self) -> xarray.Dataset:
        """The rows as a labelled data set with dimensions ``row`` and ``output``.

        Of more than 100,000 rows some: one of `every`, which is in its ``attrs``, too.

        Raises:
            MissingExtra: xarray is not installed.
        """
        try:
            import xarray
        except ModuleNotFoundError as error:
            raise MissingExtra.of("xarray", "analysis") from error
        names, rows = list(self.model.outputs.names), self._rows()
        return xarray.Dataset(
            {
                kind: (("row", "output"), rows[kind])
                for kind in ("measured", "predicted", "residual")
            },
            attrs={"every": self.every},
            coords={
                "row": rows["row"],
                "t": ("row", rows["t"] * 1e-9),
                "output": names,
                "unit": ("output", list(self.model.outputs.units)),
            },
        )

    def _lines(self) -> list[tuple[str, ...]]:
        found: list[tuple[str, ...]] = []
        for name, f in self.outputs.items():
            sizes = [v for v in (f.rms_before, f.rms_after) if not math.isnan(v)]
            if not sizes:  # a virtual sensor has no measurement to differ from
                continue
            unit, factor = suited(max(sizes), f.unit, f.recorded)
            said = "" if unit == "1" else f" {unit}"
            found.append(
                (name, said, f"{f.rms_before * factor:.4g}", f"{f.rms_after * factor:.4g}",
                 _share(f.relative_rms_before, f.relative_rms_moving_before),
                 _share(f.relative_rms_after, f.relative_rms_moving_after))
            )  # fmt: skip
        return found

    def __str__(self) -> str:
        return self.text()

    def text(self, *, every: bool = False) -> str:
        """For a terminal: what came of it, figures, decisions; ``every`` event, or these alone."""
        before, after = self.position_updates
        text = [self.headline, ""]
        text += [
            f"  {name:<10} rms {b} -> {a}{unit}" + f"   relative {rb} -> {ra}" * self.relative
            if (b, rb) != (a, ra)
            else f"  {name:<10} rms {a}{unit}{f'   relative {ra}' * self.relative}   unchanged"
            for name, unit, b, a, rb, ra in self._lines()
        ]
        if before or after:
            text.append(f"  position updates {before} -> {after}")
        text += [] if self.trial is None else [f"  {self.trial}"]
        text += uncounted(self)
        text += [f"  {tally}" for tally in self.left_out]
        decisions = self.of_kind(*DECISIONS)
        text += map(self._event, summed_up(self.events if every else decisions[-MOST:]))
        if not every:
            text += self._others(decisions[:-MOST])
        text.append(
            f"{self.name}: {self.samples} rows in {self.seconds:.2f} s; figures are of unseen rows "
            f"from {self.unseen_since} on; version {self.champion.number} is live"
            f"{', pinned' * self.pinned} ({shorter(self.champion.reason)})"
        )
        return "\n".join(text)

    def _event(self, some: Several) -> str:
        event, said = some.first, some.first.reason
        if some.times > 1:
            last = f"row {some.last.row} ({self._when(some.last)})"
            said = f"{some.times} times until {last}, first: {said}"
        at = self._when(event)
        return f"  row {event.row:>8} {at:>9}  {event.kind:<18} {event.signal:<8} {said}"

    def _when(self, event: Event) -> str:
        """Since the first row; date and time where the recording has them."""
        if event.time > DATED:
            zone = "" if self.local else "Z"
            return f"{datetime.fromtimestamp(event.time // 10**9, UTC):%Y-%m-%d %H:%M:%S}{zone}"
        start = int(self.trace["t"][0]) if len(self.trace.get("t", ())) else event.time
        return f"{1e-9 * (event.time - start):.4g} s"

    def _others(self, earlier: Sequence[Event]) -> list[str]:
        """How many events are not shown, by kind."""
        others = [event for event in self.events if event.kind not in DECISIONS]
        counts = Counter(event.kind for event in (*earlier, *others))
        if not counts:
            return []
        said = ", ".join(f"{count} {kind}" for kind, count in counts.most_common())
        return [f"  and {said} (--events shows each)"]

    def _repr_html_(self) -> str:
        """The first screen of the report for a notebook: what came of it, the picture, tables."""
        picture = resolve_name(PICTURE)(self) or ""
        head = "<tr><th>output<th>unit<th>rms before<th>after<th>relative before<th>after</tr>"
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(cell)}" for cell in row) + "</tr>"
            for row in self._lines()
        )
        events = "".join(
            f"<tr><td>{e.row}<td>{html.escape(e.kind)}<td>{html.escape(e.signal)}"
            f"<td>{html.escape(e.reason)}</tr>"
            for e in self.events
        )
        trial = "" if self.trial is None else f"; {self.trial}"
        title = html.escape(f"{self.name}: version {self.champion.number} is live{trial}")
        return (
            f"<p><b>{html.escape(self.headline)}</b></p>{picture}<p>{title}</p>"
            f"<table>{head}{body}</table>"
            f"<table><tr><th>row<th>event<th>signal<th>reason</tr>{events}</table>"
        )


def _share(whole: float, moving: float) -> str:
    """Of an output's size in %; over what moves too, where that is another figure."""
    if whole >= MANY:
        return share(whole)
    apart = f" ({100 * moving:.2f} % moving)" if abs(moving - whole) > 0.1 * whole else ""
    return f"{percent(whole)}{apart}"
