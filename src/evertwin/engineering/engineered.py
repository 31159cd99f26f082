"""The text of the twin file that a study proposes: settings with their reasons as comments.

>>> from evertwin.engineering.breakdown import Breakdown
>>> from evertwin.engineering.compile import ModelPlan
>>> text = twin_text(Breakdown("pump"), ModelPlan("thermal", {}, {}), {})
>>> print(text.splitlines()[0], text.splitlines()[1])
schema = 1 name = "pump"
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import Environment, PackageLoader

from evertwin.config.spec import SCHEMA
from evertwin.engineering.breakdown import Breakdown
from evertwin.engineering.compile import ModelPlan
from evertwin.engineering.study import Study
from evertwin.engineering.twin_file import inline, key, sections


def twin_text(
    breakdown: Breakdown, plan: ModelPlan, settings: Mapping[str, Any], study: Study | None = None
) -> str:
    """The twin file: with the editable set, the weights and the reasons where there is a study;
    before it, enough to read recordings and build the model.

    Args:
        settings: ``[twin]`` of the breakdown file.
    """
    environment = Environment(
        loader=PackageLoader("evertwin.engineering", "templates"), trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    environment.filters |= {"inline": inline, "key": key, "comment": _comment}
    choices = {} if study is None else {one.name: one for one in study.chosen.choices}
    parameters = {name: dict(entry) for name, entry in plan.parameters.items()}
    for found in () if study is None or study.identified is None else study.identified.found:
        parameters.setdefault(found.name, {}).update(value=found.value, source=found.source)
    for name, entry in parameters.items():
        entry["editable"] = name in choices and choices[name].editable
    chosen = {} if study is None else _chosen(breakdown, study)
    return environment.get_template("twin.txt").render(
        about=breakdown.about, name=breakdown.name, schema=SCHEMA, plan=plan, study=study,
        plain={k: v for k, v in settings.items() if not isinstance(v, Mapping | list)},
        levels={} if study is None else {one.component: one for one in study.levels},
        choices=choices, parameters=parameters, rules=chosen.get("indicator"),
        kept="store" in settings, sections=sections(_rest(breakdown, settings, chosen)),
    )  # fmt: skip


def _comment(text: str, indent: int = 0) -> str:
    rows = textwrap.wrap(text, 96, subsequent_indent=" " * indent)
    return "\n".join(f"# {row}" for row in rows)


def _chosen(breakdown: Breakdown, study: Study) -> dict[str, Any]:
    """Sections that the study decides."""
    tuning: dict[str, Any] = {"editable": list(study.chosen.editable)}
    tuning["every"] = f"{breakdown.requirements.interval:g} s"
    if study.weighed is not None:
        tuning["weights"] = dict(study.weighed.weights)
    rules = [
        {"name": one.name, "component": one.component.name, "parameter": one.name}
        for one in breakdown.stated
        if one.said.limit is not None and one.name in study.chosen.editable
    ]
    return {"tuning": tuning, "indicator": rules, "prognosis": _prognosis(breakdown, rules, study)}


def _rest(
    breakdown: Breakdown, settings: Mapping[str, Any], chosen: Mapping[str, Any]
) -> dict[str, Any]:
    """What ``[twin]`` says and what follows from the requirements, section by section."""
    out = {name: value for name, value in settings.items() if isinstance(value, Mapping | list)}
    for extra in ({"anomaly": {"requirement": breakdown.requirements.accuracy}}, chosen):
        for name, value in extra.items():
            if isinstance(value, list):
                out[name] = [*out.get(name, []), *value]
            else:
                out[name] = {**value, **out.get(name, {})}
    return {name: value for name, value in out.items() if value}


def _prognosis(
    breakdown: Breakdown, rules: Sequence[Mapping[str, Any]], study: Study
) -> dict[str, Any]:
    """Costs of components whose life is told, and which do not stop the machine."""
    roles = {one.component: one.role for one in study.ranks}
    parts: dict[str, dict[str, Any]] = {}
    for name in dict.fromkeys(rule["component"] for rule in rules):
        cost = breakdown.component(name).cost
        part: dict[str, Any] = {}
        if cost is not None:
            part |= {"failure": cost.failure, "maintenance": cost.maintenance}
        if roles.get(name) == "supporting":
            part["critical"] = False
        parts |= {name: part} if part else {}
    return {"components": parts} if parts else {}
