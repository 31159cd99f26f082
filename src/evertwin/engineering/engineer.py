"""From a breakdown file and recordings to a twin file that runs, with the record of every choice.

The breakdown is compiled into a model, the recordings become rows as the twin file will make them,
the study (`evertwin.engineering.study`) chooses, and the twin file is written from both: model and
start values, editable set, weights, requirement; the reasons stand beside them as comments.

`twin_text` is the text of that file:

>>> from evertwin.engineering.breakdown import Breakdown
>>> from evertwin.engineering.compile import ModelPlan
>>> text = twin_text(Breakdown("pump"), ModelPlan("thermal", {}, {}), {})
>>> print(text.splitlines()[0], text.splitlines()[1])
schema = 1 name = "pump"
"""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evertwin.config import TwinSpec, read, reads
from evertwin.config.spec import SCHEMA
from evertwin.engineering.breakdown import Breakdown, read_breakdown
from evertwin.engineering.compile import ModelPlan, compile_model
from evertwin.engineering.study import Study, modelled, study
from evertwin.errors import ConfigError, DataError
from evertwin.files import write_whole
from evertwin.ledger.versions import Versions
from evertwin.machines.catalog import with_files
from evertwin.refit.work import Work
from evertwin.rows.feed import Data, Feed
from evertwin.settings.document import Document
from evertwin.settings.writing import sections, template
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.tuning import Problem


def twin_text(
    breakdown: Breakdown, plan: ModelPlan, settings: Mapping[str, Any], study: Study | None = None
) -> str:
    """The twin file: with the editable set, the weights and the reasons where there is a study;
    before it, enough to read recordings and build the model.

    Args:
        settings: ``[twin]`` of the breakdown file.
    """
    choices = {} if study is None else {one.name: one for one in study.chosen.choices}
    parameters = {name: dict(entry) for name, entry in plan.parameters.items()}
    for found in () if study is None or study.identified is None else study.identified.found:
        parameters.setdefault(found.name, {}).update(value=found.value, source=found.source)
    for name, entry in parameters.items():
        entry["editable"] = name in choices and choices[name].editable
    chosen = {} if study is None else _chosen(breakdown, study)
    return template("engineering", "twin.txt", comment=_comment).render(
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
    out: dict[str, Any]
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


OURS = {"model": ("kind", "options", "parameters"), "tuning": ("editable", "weights")}
"""What a breakdown decides elsewhere than under ``[twin]``."""


@dataclass(frozen=True)
class Engineered:
    """A twin file, and why it is as it is.

    >>> Engineered.__name__
    'Engineered'
    """

    study: Study
    plan: ModelPlan
    text: str
    """The twin file."""
    path: Path
    """Where it was written."""


def engineer(file: str | Path, out: str | Path, data: Data = None, seed: int = 1) -> Engineered:
    """Takes a machine from its breakdown file to a twin file.

    Args:
        file: the breakdown file.
        out: the twin file to write.
        data: recordings that the choice rests on; None: those that ``[twin]`` names.
        seed: of the samples of the sensitivity analysis.

    Raises:
        ConfigError: the breakdown does not say what it must; with file and line.
        DataError: a recording cannot be read, or there is none.
        UsageError: the twin file cannot be written.
    """
    path = Path(out)
    breakdown = read_breakdown(file)
    plan = compile_model(breakdown, file=file)
    here = _settings(file, breakdown, Path(breakdown.folder) / "twin")
    text = twin_text(breakdown, plan, here)
    draft = replace(reads(text, f"{file} [twin]"), folder=breakdown.folder)
    found = study(breakdown, _problem(draft, breakdown, data), plan, seed)
    moved = _moved(plan, breakdown.folder, path, _variables(file))
    done = twin_text(breakdown, moved, _settings(file, breakdown, path), found)
    write_whole(path, done)
    model_of(read(path))
    return Engineered(found, plan, done, path)


def _problem(draft: TwinSpec, breakdown: Breakdown, data: Data) -> Problem:
    """The tuning problem on every parameter of the breakdown, as the twin will pose it."""
    if data is None and not any(source.files for source in draft.source):
        raise DataError(
            f"{breakdown.name}: the choice rests on recordings: give some with --data, or name "
            "them as files in [[twin.source]]"
        )
    model = model_of(draft)
    setup, versions = Setup(draft, model), Versions(model)
    windows = tuple(Feed(draft, model).blocks(data))
    names = modelled(breakdown, model.parameters.names)
    return Work(setup, versions).problem(versions[0], windows, names)


def _settings(file: str | Path, breakdown: Breakdown, out: Path) -> dict[str, Any]:
    """``[twin]`` as written, with its files seen from the twin file.

    Raises:
        ConfigError: it decides what the breakdown decides elsewhere.
    """
    text = Path(file).read_text(encoding="utf-8-sig")
    table = Document(text, str(file)).table.get("twin", {})
    for section, keys in OURS.items():
        for key in keys:
            if key in table.get(section, {}):
                raise ConfigError(
                    f"{file}: [twin.{section}] {key}: say it at the component or its parameter; "
                    "override = { …, reason = … } goes before what is proposed"
                )
    for source in table.get("source", []):
        if "files" in source:
            source["files"] = [_seen(breakdown.folder, name, out) for name in source["files"]]
    prognosis = table.setdefault("prognosis", {})
    prognosis.setdefault("breakdown", _seen(breakdown.folder, Path(file).name, out))
    return dict(table)


def _variables(file: str | Path) -> dict[str, str]:
    """``${NAME}`` of the breakdown file and what they stand for: the twin file keeps them."""
    found = re.findall(r"\$\{([A-Za-z_]\w*)", Path(file).read_text(encoding="utf-8-sig"))
    return {name: os.environ[name] for name in found if os.environ.get(name)}


def _moved(plan: ModelPlan, folder: str, out: Path, variables: Mapping[str, str]) -> ModelPlan:
    """The plan with files seen from the twin file."""

    def seen(name: str) -> str:
        for variable, stands in variables.items():
            if name.startswith(stands):
                return f"${{{variable}}}{name.removeprefix(stands)}"
        return _seen(folder, name, out)

    return replace(plan, options=with_files(plan.options, seen))


def _seen(folder: str, name: str, out: Path) -> str:
    """A path relative to ``folder``, seen from where the twin file will lie."""
    if name.startswith("${") or os.path.isabs(name):
        return name
    return Path(os.path.relpath(Path(folder) / name, out.resolve().parent)).as_posix()
