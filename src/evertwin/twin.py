"""The twin: open it, run it beside recorded data, fit it, ask it.

twin = Twin.open("arm.toml")
result = twin.run(["monday.csv", "tuesday.csv"])
result.outputs["tau1"].relative_rms_after
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import evertwin.ahead as ahead
import evertwin.doctor as doctor
import evertwin.engineering as engineering
import evertwin.export as export
import evertwin.ledger as ledger
import evertwin.loop as loop
import evertwin.outcome as outcome
import evertwin.prognosis as prognosis
import evertwin.refit as refit
import evertwin.rows as rows
import evertwin.setup as setup
from evertwin.ahead.spec import ScenarioSpec, read_scenario
from evertwin.config import TwinSpec, read
from evertwin.errors import StoreError, UsageError
from evertwin.fold import Block, Chunk, Event
from evertwin.models import Model, Parameters
from evertwin.models.form import Version
from evertwin.store import Store, opened

if TYPE_CHECKING:
    from evertwin.engine import Engine
    from evertwin.loop import Progress, Samples
    from evertwin.outcome import Comparison, Kpi, RunResult
    from evertwin.prognosis import Lives, Plan, Prospect, Verdict
    from evertwin.refit import FitResult, Watch
    from evertwin.rows import Data
    from evertwin.tuning import Problem

_RUNAWAY = np.errstate(over="ignore", invalid="ignore")  # runs away to infinity: told by marks


class Twin(loop.ByHand):
    """A model that is kept true to its machine.

    >>> import numpy as np
    >>> from evertwin.config.spec import ModelSpec, PredictionSpec
    >>> twin = Twin(TwinSpec("robot", ModelSpec("robot1d"), prediction=PredictionSpec(horizon=1.0)))
    >>> t = np.arange(50) * 0.1
    >>> result = twin.run({"t": t, "v": np.full(50, 0.2), "x": 0.2 * t})
    >>> result.samples, result.outputs["x"].rms_after < 1e-9
    (50, True)
    """

    def __init__(
        self, spec: TwinSpec | str | Path, model: Model | None = None, store: Store | None = None,
        *, reading: bool = False, engine: Engine | None = None,
    ) -> None:  # fmt: skip
        spec = spec if isinstance(spec, TwinSpec) else read(spec)
        self._engines = loop.Engines(spec, model is not None, engine)
        self.model = setup.model_of(spec, model)
        self.spec = spec = setup.with_units(spec, self.model)
        rows.check_units(spec, self.model)
        self.setup = setup.Setup(spec, self.model)
        path = spec.store.place(spec.folder)
        self.store: Store = store or opened(path, spec.name, reading=reading)
        self._lasting = store is not None or path is not None
        self._versions = ledger.Versions(self.model)
        self._live: loop.Live | None = None
        try:
            self._ledger = ledger.Ledger(
                self.store, self._versions, spec.name, reading=reading and path is not None
            )
        except StoreError:
            self.store.close()
            raise

    @classmethod
    def open(cls, path: str | Path, *, reading: bool = False) -> Twin:
        """The twin of a file; ``reading``: to look at, while another process works with its store.

        Raises:
            ConfigError: the file does not say what it must; with file, line and nearest key.
            StoreLocked: another process works with its store.
        """
        return cls(path, reading=reading)

    def close(self) -> None:
        """Lets go of the store, and of the processes for slow work."""
        self._engines.close()
        self.store.close()

    def __enter__(self) -> Twin:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> object:
        raise TypeError("a Twin holds its store: send its twin file to be opened, or a result")

    def __repr__(self) -> str:
        return f"<Twin {self.spec.name!r}: {type(self.model).__name__}, live {self.champion!r}>"

    @property
    def versions(self) -> tuple[Version, ...]:
        """All versions so far; the first is the model as configured."""
        return tuple(self._versions)

    @property
    def champion(self) -> Version:
        """The version that is live."""
        return self._versions[self._ledger.champion]

    def version(self, number: int) -> Version:
        """One version by number."""
        return self._versions[number]

    def parameters_of(self, number: int) -> Parameters:
        """The parameters of a version, with its values."""
        return self._versions.model(number).parameters.with_values(self._versions[number].p)

    def known_of(self, number: int) -> Mapping[str, Mapping[str, Any]]:
        """The same with what is known of each: bounds, ``interval95``, ``verdict``."""
        return export.exported(self.setup, self._versions, self.store, number, ()).parameters

    @property
    def pinned(self) -> bool:
        """Is the champion pinned?"""
        return self._ledger.pinned

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything that was decided, in order."""
        if self._live is not None:
            self._live.settle()
        return tuple(r for r in self.store.read("event") if isinstance(r, Event))

    def blocks(self, data: Data = None) -> tuple[Block, ...]:
        """The rows of recordings, one block a task."""
        return tuple(rows.Feed(self.spec, self.model).blocks(data))

    @_RUNAWAY
    def run(
        self, data: Data = None, progress: Progress | None = None, every: int = 0,
        *, again: bool = False, workers: int | None = None,
    ) -> RunResult:  # fmt: skip
        """Runs the twin beside recorded data: follow, judge, tune, correct, try, promote.

        With a store that lasts, rows are run once: a run that was cut off goes on where it stopped,
        rows of runs before are passed over, and where all of them have been run already the result
        is that of then. Rows are recognised by their content, not by the name of a file.

        Args:
            data: files, tables, blocks; None: the twin file's recordings. A table (DataFrame,
                Arrow, records) with a source's columns is read as its file, in its units; else,
                and a mapping first, by channel, in the model's units (SI), ``t`` in seconds.
            progress: called now and then with rows and seconds of data.
            every: rows from checkpoint to checkpoint; 0: about one a second.
            again: run all rows as a new run, also those that have been run before.
            workers: processes for slow work, 0: none but this; None: as ``[engine] workers`` says.

        Raises:
            UsageError: workers for a model that was given as an object.
            DataError: a recording cannot be read.
            StoreError: a repeated run says something else than the log has.
        """
        engine, observer = self._engines.of(workers), loop.Observer(self.setup, progress)
        run = loop.Run(self.setup, self._ledger, observer, engine, every)
        return run.play(data, anew=again, lasting=self._lasting)

    def kpi(self, result: RunResult, changed: float | None = None) -> Kpi:
        """What a run of this twin is compared by with others; rates are of all runs in its log.

        Args:
            result: of `run` or `finish`.
            changed: when the machine is known to have changed [s of data]; None: nobody knows.
        """
        return outcome.kpi_of(self.setup, self._ledger, result, changed)

    def problem(self, train: Data = None) -> Problem:
        """What `fit` tunes the champion on, for `evertwin.tuning.solve` and its like."""
        return refit.posed(self.setup, self._versions, self.champion.number, self.blocks(train))[0]

    @_RUNAWAY
    def push(self, samples: Samples) -> None:
        """More samples of one source as they come, folded; the run goes on to `finish`.

        They become durable after the return, before what is said of them, or by ``store.flush()``.

        Args:
            samples: of a source of the twin file; or a table as in `run`, or one row as numbers.
        """
        self.going(samples).push(samples)

    def going(self, *first: Samples) -> loop.Live:
        """The run of pushed samples: it begins, or goes on where a process before was cut off."""
        if self._live is None:
            here, engine = (self.setup, self._ledger, first), self._engines.of(None)
            self._live = loop.Live.of(*here, engine, self._lasting)
        return self._live

    def samples(
        self, source: str, first: float = -math.inf, last: float = math.inf
    ) -> Iterator[Chunk]:
        """Pushed samples of a source that are kept, arrays too, stamped in [first, last] [s]."""
        low, high = (int(1e9 * min(max(edge, -4e9), 4e9)) for edge in (first, last))
        return self.store.samples(source, low, high)

    def view(self, rows: int = 1000) -> outcome.View:
        """The newest rows that were pushed: measured, predicted, band, mark, version."""
        return self._pushed().view(rows)

    @_RUNAWAY
    def finish(self) -> RunResult:
        """Ends the run of the samples that were pushed."""
        result, self._live = self._pushed().finish(), None
        return result

    def _pushed(self) -> loop.Live:
        left = self._ledger.unfinished
        goes_on = left is not None and left.pushed and self.spec.source and not self._ledger.reading
        if self._live is None and not goes_on:
            raise UsageError("no samples were pushed: Twin.push begins a run, or goes on with it")
        return self.going()

    @_RUNAWAY
    def fit(
        self, train: Data = None, test: Data | Sequence[Any] = (), watch: Watch | None = None,
        workers: int | None = None,
    ) -> FitResult:  # fmt: skip
        """Tunes the champion on ``train`` and judges it on each of ``test``; changes nothing live.

        Args:
            train: recordings to learn from, as in `run`.
            test: recordings that are not learned from, each judged alone and all together.
            watch: called with evaluations and cost while a search runs; False ends it, as Ctrl-C
                does, with the best values so far.
            workers: processes for the simulations of a model in slow Python; else as in `run`.

        Raises:
            UsageError: workers for a model that was given as an object.
            WorkLost: a process died, or its work took more than it may.
        """
        data, engine = (train, test), self._engines.of(workers)
        return refit.fit(self.setup, self._versions, self.champion.number, data, watch, engine)

    @_RUNAWAY
    def doctor(self, data: Data = None) -> doctor.Diagnosis:
        """What is wrong, or will be: units, lag, excitation, what is not identifiable."""
        return doctor.diagnose(self.setup, self._versions, self.champion.number, data)

    @_RUNAWAY
    def validate(self, test: Sequence[Any] = (), train: Data = None) -> engineering.Validation:
        """Verifies the champion (other engines, laws) and validates it on held-out recordings.

        Args:
            test: recordings that it was not tuned on; none: those that the twin file names.
            train: recordings that it is tuned on first; None: it is taken as it is.
        """
        here = self.setup, self._versions, self.champion.number
        return engineering.validated(*here, tuple(test), train)

    @_RUNAWAY
    def compare(self, a: int, b: int, data: Data = None) -> Comparison:
        """Two versions over the same data."""
        return outcome.compare(self.setup, self._versions, (a, b), data)

    def prospect(self, history: str | Path | None = None, data: Data = None) -> Prospect:
        """What lives and scenarios are told from: the live version, its history, recordings."""
        basis = ahead.Basis(self.setup, self._versions, self.store, self.champion.number)
        told = None if history is None else ahead.read_table(history)
        return prognosis.Prospect(basis, data, told)

    @_RUNAWAY
    def forecast(
        self, horizon: float, data: Data = None, mode: ahead.Mode = "repeat",
        inputs: str | Path | ahead.Planned | None = None,
    ) -> ahead.Forecast:  # fmt: skip
        """What the machine will do from the end of its recordings on, with bands.

        Args:
            horizon: how far [s]; with ``inputs``: as far as these reach.
            data: recordings up to now; None: the twin file's.
            mode: ``repeat`` the newest inputs, or ``hold`` the last ones.
            inputs: CSV with ``t`` and the inputs to come, as recorded or in the units recorded;
                `ahead.Planned` says how much of it.
        """
        basis = self.prospect().basis
        told = ahead.Planned(Path(inputs)) if isinstance(inputs, str | Path) else inputs
        return ahead.forecast(basis, horizon, data, mode, told)

    @_RUNAWAY
    def life(
        self, history: str | Path | None = None, data: Data = None, *, drawn: bool = False,
        from_today: bool = False,
    ) -> Lives:  # fmt: skip
        """The remaining life of each component; alarms that are due go into the log.

        Args:
            history: CSV in place of the store's parameter history; then nothing is logged.
            data: recordings, where a limit or the work ahead is simulated.
            drawn: also the course of each indicator, for pictures.
            from_today: counted from today, if all still works; else from the newest row.
        """
        lives = replace(self.prospect(history, data), from_today=from_today).lives(drawn=drawn)
        if history is None:
            lives, events = prognosis.alarmed(self.store, lives, self.setup.spec.prognosis)
            if not self._ledger.reading:
                self._ledger.say(*events)
        return lives

    @_RUNAWAY
    def whatif(
        self, scenario: str | Path | ScenarioSpec, data: Data = None,
        history: str | Path | None = None,
    ) -> ahead.WhatIf:  # fmt: skip
        """A scenario (file) beside today, simulated with the live version."""
        told = scenario if isinstance(scenario, ScenarioSpec) else read_scenario(scenario)
        prospect = self.prospect(history, data)
        found = prognosis.run_scenario(prospect, told)
        if told.docking is None:
            return found
        with Twin.open(Path(told.folder) / told.docking.machine) as second:
            docked = ahead.dock(prospect.basis, second.prospect().basis, told.docking, data)
        return replace(found, docking=docked.to_dict())

    @_RUNAWAY
    def plan(self, history: str | Path | None = None, data: Data = None) -> Plan:
        """The cheapest date of maintenance for each component, with what the operator said."""
        prospect = self.prospect(history, data)
        return prognosis.plan(prospect, prospect.lives())

    @_RUNAWAY
    def decide(
        self, component: str, verdict: Verdict, reason: str, after: float | None = None,
        history: str | Path | None = None,
    ) -> Event:  # fmt: skip
        """Keeps what the operator says to a planned date; ``withdrawn`` takes the newest word back.

        Args:
            component: whose date.
            verdict: what is said to it.
            reason: why.
            after: postponed until, or confirmed for, this time from now.
            history: CSV that the plan is made from, in place of the store's history.
        """
        event = prognosis.label(self.prospect(history), component, verdict, reason, after)
        self._ledger.say(event)
        return event

    def maintained(
        self, component: str, reason: str, kind: str = "replaced", at: float | None = None,
        history: str | Path | None = None,
    ) -> Event:  # fmt: skip
        """Keeps maintenance that was done: a new life begins (``adjusted``: a shifted level)."""
        event = prognosis.maintenance(self.prospect(history), component, reason, kind, at)
        self._ledger.say(event)
        return event

    @_RUNAWAY
    def export(
        self, path: str | Path, form: str, number: int | None = None, data: Data = None
    ) -> export.Written:
        """Writes a version to a file.

        Args:
            path: file to write.
            form: ``json``, ``mat``, ``urdf``, or another of `evertwin.export.FORMATS`.
            number: version; None: the champion.
            data: recordings that go along with what the version predicts of them; None: none.
        """
        chosen = self.champion.number if number is None else number
        rows = () if data is None else self.blocks(data)
        out = export.exported(self.setup, self._versions, self.store, chosen, rows)
        return export.write(out, form, Path(path))

    def load(self, path: str | Path, reason: str = "") -> Version:
        """A new version with the parameter values of a JSON or MAT file; nothing goes live.

        The form is the champion's; what the file does not name stays as the champion has it.

        Raises:
            DataError: the file holds no parameters, or one that the model has not.
            UsageError: a value lies outside its bounds.
        """
        file, live = Path(path), self.champion
        values = export.values_in(file, live.names)
        return self._ledger.keep(live.form, values, reason or f"loaded from {file.name}")

    def keep(self, found: FitResult, reason: str = "found by a fit") -> Version:
        """A new version of what `fit` has found, its terms included; nothing goes live."""
        values = {item.name: item.value for item in found.parameters}
        return self._ledger.keep(found.form, values, reason, found.sizes)
