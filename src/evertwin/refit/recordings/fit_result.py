"""What a fit says: parameters, deviations, and whether the twin's requirement is reached.

>>> held = Held(5.0, False, True, {"y": (44.0, "44 mV", "5 mV"), "z": (2.0, "2 mV", "5 mV")})
>>> print(held)
requirement on the tests: not reached: y is off by 44 mV (limit 5 mV)
>>> held.by("z"), held.reached
(True, False)
>>> print(held._replace(outputs={"y": (0.0, "0 mV", "5 mV")}, tested=False, few=0))
requirement on what it learned from: not known, for too few values tell it (0): y is off by 0 mV \
(limit 5 mV)
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from evertwin.errors import few
from evertwin.fold import interval, plain
from evertwin.models import Parameters
from evertwin.models.form import Form, Size
from evertwin.models.functions.failures import Failed
from evertwin.setup.evaluation import Deviation
from evertwin.signals.spoken import number, percent
from evertwin.sources.clocks.tally import Tally
from evertwin.tuning import Fit
from evertwin.types import Json

NO_VALUE = (
    "rows without a value of an input, behind which predictions begin anew (a command that goes on "
    "acting: [signals.NAME] hold = true)"
)
WORSE = 2.0
"""Times as far off as in what was learned from: more than another recording makes."""


class Held(NamedTuple):
    """The requirement, and what each watched output is off by. See the module for an example."""

    limit: float
    relative: bool
    tested: bool
    """Was it asked of recordings that were not learned from?"""
    outputs: Mapping[str, tuple[float, str, str]]
    """Output → what it is off by, as the requirement has it, and both in words."""
    advice: str = ""
    """What may help where it is not reached."""
    failed: Failed | None = None
    """Rows that the model could not compute: whether it is reached there, nobody knows."""
    silent: tuple[str, ...] = ()
    """Watched outputs of which no row counts, as where a joint stands."""
    few: int = -1
    """Values, less the numbers that were tuned to them, where these are too few to tell it; −1:
    enough."""

    @property
    def reached(self) -> bool:
        """By all outputs, at all rows, by enough of them."""
        return self.failed is None and self.few < 0 and all(map(self.by, self.outputs))

    def by(self, name: str) -> bool:
        """By one output, at the rows that the model could compute."""
        return name in self.outputs and self.outputs[name][0] <= self.limit

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        return {
            "limit": self.limit, "relative": self.relative, "reached": self.reached,
            "on": "test" if self.tested else "train",
            "outputs": {
                name: {"off": off, "reached": self.by(name)}
                for name, (off, _, _) in self.outputs.items()
            },
        }  # fmt: skip

    def __str__(self) -> str:
        where = "on the tests" if self.tested else "on what it learned from"
        shown = {name: said for name, (_, *said) in self.outputs.items()}
        far = [name for name in shown if not self.by(name)]
        told = ", ".join(
            f"{name} is off by {shown[name][0]} (limit {shown[name][1]})" for name in far or shown
        )
        reached = "not reached" if far else "reached"
        if self.failed and not far:
            rows = f"{self.failed.rows} of {self.failed.of}"
            reached = f"not known at {rows} rows, that the model could not compute; at the others"
        elif self.few >= 0 and not far:
            reached = f"not known, for too few values tell it ({self.few})"
        advice = f"; {self.advice}" if far and self.advice else ""
        silent = f"; no row tells of {', '.join(self.silent)}" if self.silent else ""
        return f"requirement {where}: {reached}: {told}{silent}{advice}"


@dataclass(frozen=True)
class FitResult:
    """The outcome of `Twin.fit`.

    >>> FitResult.__name__
    'FitResult'
    """

    name: str
    fit: Fit
    train: tuple[Deviation, ...]
    test: tuple[Deviation, ...]
    """Over all tests together; empty without tests."""
    tests: tuple[tuple[str, tuple[Deviation, ...]], ...]
    """Each test alone."""
    laws: Mapping[str, str]
    """Output → friction law that was chosen."""
    causes: Mapping[str, str]
    """Output → what the terms of its law mean, where it has some."""
    filter: Mapping[str, Json] | None
    parameters: Parameters
    form: Form = Form()
    """Terms that the model has, those included that this fit has found."""
    unknown: str = ""
    """Why no form that was tried is the machine's; empty where one may be, or none was tried."""
    search: Mapping[str, Any] = field(default_factory=dict)
    """The search for terms, if there was one: held-out errors before and after."""
    starts: tuple[tuple[Mapping[str, float], ...], ...] = ()
    """Per test and task of it: the parameters that belong to a recording, fitted to it."""
    left_out: tuple[Tally, ...] = ()
    """What was wrong with the recordings, and the rows left out for it, by source."""
    spoiled: Mapping[str, int] = field(default_factory=dict)
    """Channel → rows to learn from that cannot be a measurement, and were left out."""
    held: Held | None = None
    """Is the requirement of the twin file reached? None: it has none."""
    failed: Failed | None = None
    """Rows that the model could not compute, its step having raised something; they count
    nowhere."""
    without: Mapping[str, int] = field(default_factory=dict)
    """Input → rows to learn from that have no value of it; predictions begin anew behind them."""
    doubt: str = ""
    """How a channel looks read wrongly, so that the numbers are none of the machine."""
    sizes: tuple[Size, ...] = ()
    """How large outputs were in what was learned from: what a share is a share of, later."""
    later: frozenset[str] = frozenset()
    """Numbers of what the machine is built of, shown behind those that wear or are carried."""

    def to_dict(self) -> dict[str, Json]:
        """Plain content, ``schema: "evertwin.fit/1"``."""
        whole: Any = self.fit.to_dict()
        parameters: Any = {
            name: item | {"interval95": interval(item["interval95"])}
            for name, item in whole["parameters"].items()
        }
        tested = {d.name: d for d in self.test}
        outputs = {}
        for d in self.train:
            there = tested.get(d.name)
            outputs[d.name] = {
                "unit": d.unit, "rms_train": d.rms, "relative_rms_train": d.relative_rms,
                "relative_rms_train_moving": d.relative_rms_moving,
                "rms_test": there and there.rms,
                "relative_rms_test": there and there.relative_rms,
                "relative_rms_test_moving": there and there.relative_rms_moving,
                "moving": there.moving if there else d.moving,
            }  # fmt: skip
        return plain(  # type: ignore[return-value]
            {
                "schema": "evertwin.fit/1",
                "name": self.name,
                "parameters": parameters,
                "outputs": outputs,
                "tests": [
                    {
                        "file": file,
                        "outputs": {d.name: d.to_dict() for d in found},
                        "fitted_to_the_test": list(starts),
                    }
                    for (file, found), starts in zip(self.tests, self._starts, strict=True)
                ],
                "requirement": self.held and self.held.to_dict(),
                "holds": not self.unseen,
                "filter": self.filter,
                "form": {
                    "terms": self.form.terms,
                    "search": self.search,
                    "unknown": self.unknown,
                    "doubt": self.doubt,
                },
                "friction_law": self.laws,
                "friction_causes": self.causes,
                "left_out": [tally.to_dict() for tally in self.left_out],
                "rows_left_out": self.spoiled,
                "rows_without_input": self.without,
                "model_failed": self.failed and self.failed.to_dict(),
                "converged": self.fit.converged,
                "message": self.fit.message,
                "method": self.fit.method,
                "iterations": self.fit.iterations,
                "evaluations": self.fit.evaluations,
                "seconds": self.fit.seconds,
            }
        )

    @property
    def _starts(self) -> tuple[tuple[Mapping[str, float], ...], ...]:
        """Per test; what nothing was fitted to has none."""
        filled = tuple(tuple(s for s in starts if s) for starts in self.starts)
        return filled or ((),) * len(self.tests)

    @property
    def unseen(self) -> str:
        """Which output is much further off on recordings that were not learned from, in absolute
        and in relative figures; empty where none is, or where the requirement is reached there."""
        trained = {one.name: one for one in self.train}
        far = [
            (one.relative_rms / trained[one.name].relative_rms, one, file)
            for file, found in self.tests for one in found
            if _worse(one, trained.get(one.name)) and not (self.held and self.held.by(one.name))
        ]  # fmt: skip
        if not far:
            return ""
        _, one, file = max(far, key=lambda found: found[0])
        return (
            f"does not hold on data it has not seen: {one.name} is off by "
            f"{percent(one.relative_rms)} in {file}, by "
            f"{percent(trained[one.name].relative_rms)} in what it learned from: the form is "
            "another, or the numbers were told by too little"
        )

    def __repr__(self) -> str:
        off = few(f"{one.name} by {percent(one.relative_rms)}" for one in self.test or self.train)
        tuned = dict(zip(self.fit.names, self.fit.values, strict=True))
        told = few(f"{name}={value:.6g}" for name, value in tuned.items())
        return f"<FitResult of {self.name!r}: {told}; off {off}>"

    def __str__(self) -> str:
        """What speaks against it, parameters, then deviations per recording."""
        doubts = [f"look at {one.source} first: {one.doubt}" for one in self.left_out if one.doubt]
        lines = [*doubts, *filter(None, [self.doubt, self.unseen]), self.fit.text(self.later)]
        lines = [f"{self.failed}: these rows are left out", *lines] if self.failed else lines
        lines += [
            f"law of {output}: {law}"
            + (f" ({self.causes[output]})" if output in self.causes else "")
            for output, law in self.laws.items()
        ]
        lines += [f"the form is not known: {self.unknown}"] if self.unknown else []
        lines += [f"terms: {said}" for said in self._described()]
        shown = (("train", self.train), *self.tests)
        for file, found in (*shown, ("all tests", self.test)) if self.test else shown:
            lines.append(f"{file}:")
            lines += [
                f"  {d.name:<10} rms {number(*d.told)} {percent(d.relative_rms):>9}   moving "
                f"{percent(d.relative_rms_moving):>9} of {d.moving} rows"
                for d in found
                # a virtual sensor has no measurement to differ from
                if not math.isnan(d.rms)
            ]
        lines += [str(self.held)] if self.held and self.held.outputs else []
        if any(self._starts):
            names = ", ".join(self._starts[0][0])
            lines.append(f"fitted to each test, since they belong to a recording: {names}")
        lines += map(str, self.left_out)
        out = ", ".join(f"{count} of {name}" for name, count in self.spoiled.items())
        lines += [f"rows left out that cannot be a measurement: {out}"] if out else []
        out = ", ".join(f"{count} of {name}" for name, count in self.without.items())
        return "\n".join([*lines, f"{NO_VALUE}: {out}"] if out else lines)

    def _described(self) -> list[str]:
        if not self.search:
            return []
        found = self.search
        if not self.form.terms and "tuned" in found:  # the tuned numbers do as well without them
            left = ", ".join(
                f"{one['output']} {one['without']:.3g} -> {one['with']:.3g}"
                for one in found["tuned"]
            )
            return [f"none: {'; '.join(found['describes'])} would leave hardly less (rms {left})"]
        terms = ", ".join(f"{t.kind} on {t.channel}" for t in self.form.terms) or "none"
        return [
            f"{terms} ({found['judged']}: {found['before']:.3g} -> {found['after']:.3g})",
            *found["describes"],
        ]

    def _repr_html_(self) -> str:
        return f"{self.fit._repr_html_()}<pre>{html.escape(str(self))}</pre>"


def _worse(one: Deviation, trained: Deviation | None) -> bool:
    """Is an output much further off than in what was learned from, by either figure?"""
    if trained is None or not trained.relative_rms > 0.0:
        return False
    relative, size = one.relative_rms / trained.relative_rms, one.rms / trained.rms
    return min(relative, size) > WORSE
