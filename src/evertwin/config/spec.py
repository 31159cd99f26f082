"""What a twin file says, as frozen dataclasses. `Twin` can be built from them without a file.

Every section of the file is one class, every key one field; the JSON schema, the checks and the
reference page are generated from here. Each room owns its settings; here they make one file. A
quantity may be written as a number in SI or as text with its unit (``"2 cm"``); its value is always
SI.

>>> TwinSpec(name="robot", model=ModelSpec(kind="robot1d")).prediction.horizon
inf
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated

from evertwin.anomaly.spec import AnomalySpec
from evertwin.config.prognosis import AccuracySpec, CostSpec, IndicatorSpec, PrognosisSpec, WorkSpec
from evertwin.correction.spec import CorrectionSpec, SarsaSpec
from evertwin.engine.spec import EngineSpec
from evertwin.errors import UsageError
from evertwin.features.spec import LabelsSpec, PerceptionSpec
from evertwin.fold.span import Span
from evertwin.models.spec import ModelSpec, ParameterSpec
from evertwin.settings.notes import Hidden, Path, PlacedError, Rows, dotted
from evertwin.settings.section import Section, settings
from evertwin.sources.spec import ArraySpec, ChannelSpec, SourceSpec, TimeSpec
from evertwin.store.spec import StoreSpec
from evertwin.sync.spec import (
    ArbiterSpec,
    ClockSpec,
    CropSpec,
    DeriveSpec,
    FilterSpec,
    MovingSpec,
    SignalSpec,
)
from evertwin.trial.spec import TrialSpec
from evertwin.tuning.spec import CutSpec, PredictionSpec, TuningSpec

__all__ = [
    "SCHEMA",
    "AccuracySpec",
    "AnomalySpec",
    "ArbiterSpec",
    "ArraySpec",
    "ChannelSpec",
    "ClockSpec",
    "CorrectionSpec",
    "CostSpec",
    "CropSpec",
    "CutSpec",
    "DeriveSpec",
    "EngineSpec",
    "FilterSpec",
    "IndicatorSpec",
    "LabelsSpec",
    "ModelSpec",
    "MovingSpec",
    "ParameterSpec",
    "PerceptionSpec",
    "PredictionSpec",
    "PrognosisSpec",
    "SarsaSpec",
    "SignalSpec",
    "SourceSpec",
    "Span",
    "StoreSpec",
    "TimeSpec",
    "TrialSpec",
    "TuningSpec",
    "TwinSpec",
    "WorkSpec",
]

SCHEMA = 1
"""Version of the twin file that this evertwin reads."""


@dataclass(frozen=True)
class TwinSpec(Section):
    """A whole twin file.

    >>> TwinSpec(name="box", model=ModelSpec(kind="thermal")).schema
    1
    """

    name: str
    """Name of the twin."""
    model: ModelSpec
    """Which model, with which options."""
    schema: int = SCHEMA
    """Version of the file's schema."""
    source: tuple[SourceSpec, ...] = ()
    """Recorded sources, one ``[[source]]`` each."""
    array: tuple[ArraySpec, ...] = ()
    """Scans, images and the like, stored beside the rows, one ``[[array]]`` each."""
    perception: PerceptionSpec | None = None
    """The pose from scans; absent: it is recorded."""
    labels: LabelsSpec | None = None
    """What a detector says, watched for drift; absent: nothing."""
    derive: tuple[DeriveSpec, ...] = ()
    """Channels computed from others, one ``[[derive]]`` each."""
    signals: Mapping[str, SignalSpec] = field(default_factory=dict)
    """The model's channels by name; those not named are recorded under their own names."""
    clock: ClockSpec = ClockSpec()
    """The rows."""
    filter: FilterSpec | None = None
    """The filter over measurement and prediction; absent: none."""
    moving: MovingSpec | None = None
    """Which rows count as moving; absent: all."""
    arbiter: ArbiterSpec = ArbiterSpec()
    """How measurements are judged."""
    prediction: PredictionSpec = PredictionSpec()
    """Over which horizon models are compared and tuned."""
    anomaly: AnomalySpec = AnomalySpec()
    """When the twin is suspected to differ from its machine."""
    tuning: TuningSpec = TuningSpec()
    """Which parameters, how, when."""
    correction: CorrectionSpec = CorrectionSpec()
    """How the model's form may be corrected."""
    trial: TrialSpec = TrialSpec()
    """The gate to the live model."""
    engine: EngineSpec = EngineSpec()
    """Where slow work runs."""
    store: StoreSpec = StoreSpec()
    """Where versions, events and checkpoints are kept."""
    indicator: tuple[IndicatorSpec, ...] = ()
    """What tells wear, one ``[[indicator]]`` each."""
    prognosis: PrognosisSpec = PrognosisSpec()
    """How lives are counted and maintenance is planned."""
    work: tuple[WorkSpec, ...] = ()
    """The work that lies ahead, one ``[[work]]`` each; absent: as it was."""
    beat: Annotated[Span, Rows()] = Span(100)
    """Rows, or time, from decision to decision."""
    folder: Annotated[str, Hidden()] = field(default=".", compare=False)
    """Folder of the twin file; set when it is read."""
    file: Annotated[str, Hidden()] = field(default="", compare=False)
    """The twin file, as messages name it; set when it is read."""
    contents: Annotated[str, Hidden()] = ""
    """A hash of the files that its model is of; set by who asks whether they have changed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for place, rows, span in self._times():
            self._spans(rows, span, place)
        self._perceives()
        self._labelled()
        for k, one in enumerate(self.derive):
            if one.op == "slope" and self.clock.rate is None:
                raise PlacedError(
                    f"derive {one.name}: a slope is of rows at a fixed rate: say [clock] rate, as "
                    "in '10 Hz'", ("derive", k, "op"),
                )  # fmt: skip

    def __repr__(self) -> str:
        sources = ", ".join(one.name for one in self.source)
        return f"<TwinSpec {self.name!r}: model {self.model.kind}, sources {sources or 'none'}>"

    def rows(self, span: Span, rate: float | None) -> int:
        """The rows of one of its spans, at the rate of the clock, or of the data.

        Raises:
            UsageError: a time, and neither rate is known; the key is named.
        """
        try:
            return span.at(self.clock.rate or rate)
        except UsageError as error:
            keys = [f"{dotted(place)} = " for place, _, own in self._times() if own is span]
            raise UsageError("".join((*keys[:1], str(error)))) from error

    def _perceives(self) -> None:
        """What ``[perception]`` names is there."""
        rule = self.perception
        if rule is None:
            return
        found = {one.name: one.shape for one in self.array}
        if len(found.get(rule.scan, ())) != 1:
            there = ", ".join(found) or "none"
            raise PlacedError(
                f"perception: scan: expected the name of an [[array]] of ranges, as shape = [360], "
                f"got {rule.scan!r}: there are {there}", ("perception", "scan"),
            )  # fmt: skip
        if any(source.name == rule.scan for source in self.source):
            raise PlacedError(
                f"perception: scan: a [[source]] is called {rule.scan!r} too: rename it",
                ("perception", "scan"),
            )
        if self.clock.rate is not None and self.clock.gap is None:
            raise PlacedError(
                "perception: rows at a fixed rate lie between poses, also where there was none for "
                "long: say [clock] gap, over how long at most, or every in place of [clock] rate",
                ("perception",),
            )
        for key, names in (("wheels", rule.wheels), ("gyro", (rule.gyro,) * bool(rule.gyro))):
            if names and not any({*names} <= {*one.channels} for one in self.source):
                raise PlacedError(
                    f"perception: {key}: no [[source]] has the channels {', '.join(names)}",
                    ("perception", key),
                )

    def _labelled(self) -> None:
        """What ``[labels]`` names is there."""
        rule = self.labels
        shapes = [one.shape for one in self.array if rule is not None and one.name == rule.source]
        if rule is not None and shapes not in ([(3,)], [(4,)]):
            raise PlacedError(
                "labels: source: expected the name of an [[array]] of shape [3] or [4], got "
                f"{rule.source!r}", ("labels", "source"),
            )  # fmt: skip

    def _times(self) -> Iterator[tuple[Path, Rows, Span]]:
        """What may be written as rows or as a time, with its place and bounds."""
        sections = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        for name, section in {"": self, **sections}.items():
            for setting in settings(type(section)) if isinstance(section, Section) else ():
                rows = setting.note(Rows)
                if rows is not None:
                    place = (name, setting.key) if name else (setting.key,)
                    yield place, rows, getattr(section, setting.name)

    def _spans(self, rows: Rows, span: Span, place: Path) -> None:
        """A time is so many rows of the clock, where it has a rate."""
        if span.rows is None and self.clock.rate is None:
            return
        try:
            count = span.at(self.clock.rate)
        except UsageError as error:
            raise PlacedError(f"{dotted(place)} = {error}", place) from error
        if not rows.least <= count <= rows.most:
            raise PlacedError(
                f"{dotted(place)}: expected {rows.least} to {rows.most} rows, got {span}", place
            )
