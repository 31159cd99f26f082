"""The text of the twin file that a study proposes: settings with their reasons as comments.

>>> from evertwin.engineering.breakdown import Breakdown
>>> from evertwin.engineering.compile import ModelPlan
>>> text = TwinText(Breakdown("pump"), ModelPlan("thermal", {}, {}), {}).draft()
>>> print(text.splitlines()[0], text.splitlines()[1])
schema = 1 name = "pump"
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evertwin.config.spec import SCHEMA
from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.compile import ModelPlan
from evertwin.engineering.study import Study
from evertwin.engineering.twin_file import inline, key, sections


@dataclass(frozen=True)
class TwinText:
    """What the file is made of. See the module for an example."""

    breakdown: Breakdown
    plan: ModelPlan
    settings: Mapping[str, Any]
    """``[twin]`` of the breakdown file."""

    def draft(self) -> str:
        """The file before anything is chosen: enough to read recordings and build the model."""
        return self._head() + self._model({}) + sections(self._rest({}))

    def whole(self, study: Study) -> str:
        """The file with the editable set, the weights and the reasons."""
        editable = set(study.chosen.editable)
        said = {one.name: (one.name in editable, one.reason) for one in study.chosen.choices}
        tuning: dict[str, Any] = {"editable": list(study.chosen.editable)}
        tuning["every"] = f"{self.breakdown.requirements.interval:g} s"
        if study.weighed is not None:
            tuning["weights"] = dict(study.weighed.weights)
        rules = self._indicators(editable)
        chosen = {"tuning": tuning, "indicator": rules, "prognosis": self._prognosis(rules, study)}
        first = () if study.identified is None else study.identified.found
        found = {one.name: {"value": one.value, "source": one.source} for one in first}
        return "".join(
            [
                self._head(), self._why(study), self._model(said, found),
                sections(self._rest(chosen)), self._store(rules), self._schedule(study),
            ]
        )  # fmt: skip

    def _head(self) -> str:
        about = f"# {self.breakdown.about}\n" if self.breakdown.about else ""
        return f"{about}schema = {SCHEMA}\nname = {inline(self.breakdown.name)}\n" + "".join(
            f"{name} = {inline(value)}\n"
            for name, value in self.settings.items()
            if not isinstance(value, Mapping | list)
        )

    def _why(self, study: Study) -> str:
        """Components, most critical first, with their depth."""
        lines = ["Components by effect × proneness, and how deeply each is modelled:"]
        levels = {one.component: one for one in study.levels}
        for one in study.ranks:
            level = levels[one.component]
            told = f"  {one.component}: {one.score:.3g}, {one.role}, {level.level}: {level.reason}"
            lines += textwrap.wrap(told, 96, subsequent_indent="    ")
            for m in level.missing:
                told = f"    missing: {m.what}; how to get it: {m.how}"
                lines += textwrap.wrap(told, 96, subsequent_indent="      ")
        return _comment(lines)

    def _model(
        self,
        said: Mapping[str, tuple[bool, str]],
        found: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> str:
        """``[model]``: components line by line, then start values, each with its reason."""
        plan = self.plan
        lines = ["", "[model]", f"kind = {inline(plan.kind)}", "", "[model.options]"]
        for name, value in plan.options.items():
            if name == "components" and isinstance(value, list | tuple):
                rows = [f"  {inline(line)}," for line in value]
                lines += [f"{key(name)} = [", *rows, "]"]
            else:
                lines.append(f"{key(name)} = {inline(value)}")
        lines += ["", "[model.parameters]"]
        every: dict[str, Mapping[str, Any]] = dict(plan.parameters)
        for name, entry in (found or {}).items():
            every[name] = {**every.get(name, {}), **entry}
        for name, entry in every.items():
            editable, reason = said.get(name, (False, ""))
            if reason:
                lines += [f"# {row}" for row in textwrap.wrap(f"{name}: {reason}", 96)]
            lines.append(f"{key(name)} = {inline({**entry, 'editable': editable})}")
        return "\n".join(lines) + "\n\n"

    def _rest(self, chosen: Mapping[str, Any]) -> dict[str, Any]:
        """What ``[twin]`` says and what follows from the requirements, section by section."""
        accuracy = {"anomaly": {"requirement": self.breakdown.requirements.accuracy}}
        out: dict[str, Any] = {
            name: value
            for name, value in self.settings.items()
            if isinstance(value, Mapping | list)
        }
        for extra in (accuracy, chosen):
            for name, value in extra.items():
                if isinstance(value, list):
                    out[name] = [*out.get(name, []), *value]
                else:
                    out[name] = {**value, **out.get(name, {})}
        return {name: value for name, value in out.items() if value}

    def _indicators(self, editable: set[str]) -> list[dict[str, Any]]:
        """Tuned parameters with a limit of health."""
        return [
            {"name": one.name, "component": one.component.name, "parameter": one.name}
            for one in self.breakdown.stated
            if one.said.limit is not None and one.name in editable
        ]

    def _prognosis(self, rules: Sequence[Mapping[str, Any]], study: Study) -> dict[str, Any]:
        """Costs of components whose life is told, and which do not stop the machine."""
        roles = {one.component: one.role for one in study.ranks}
        parts: dict[str, dict[str, Any]] = {}
        for name in dict.fromkeys(rule["component"] for rule in rules):
            cost = self.breakdown.component(name).cost
            part: dict[str, Any] = {}
            if cost is not None:
                part |= {"failure": cost.failure, "maintenance": cost.maintenance}
            if roles.get(name) == "supporting":
                part["critical"] = False
            parts |= {name: part} if part else {}
        return {"components": parts} if parts else {}

    def _store(self, rules: Sequence[Mapping[str, Any]]) -> str:
        """Where the history of what wears may be kept, as a comment."""
        if not rules or "store" in self.settings:
            return ""
        said = "With these two lines every run keeps what it tuned: life and plan are told by it."
        return _comment([said, "[store]", f'path = "{self.breakdown.name}.db"'])

    def _schedule(self, study: Study) -> str:
        """The figures of the schedule, as a comment."""
        if study.weighed is None or study.measured is None:
            return ""
        found = study.measured
        lines = ["Why the weights are as they are:"]
        for name, reason in study.weighed.reasons.items():
            lines += textwrap.wrap(f"  {name}: {reason}", 96, subsequent_indent="    ")
        lines += textwrap.wrap(
            f"Measured over {found.tunings} successive tunings: {found.count} instead of "
            f"{found.count_all} parameters tuned, run time (solved at once) less by "
            f"{found.saved:.0%}, largest loss of accuracy of an output {found.lost:.2%}.",
            96,
        )
        return _comment(lines)


def _comment(lines: list[str]) -> str:
    return "\n" + "\n".join(f"# {line}" for line in lines) + "\n"
