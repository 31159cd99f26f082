"""From a breakdown file and recordings to a twin file that runs, with the record of every choice.

The breakdown is compiled into a model, the recordings become rows as the twin file will make them,
the study (`evertwin.engineering.study`) chooses, and the twin file is written from both: model and
start values, editable set, weights, requirement; the reasons stand beside them as comments.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evertwin.config import TwinSpec, read, reads
from evertwin.engineering.breakdown import Breakdown, read_breakdown
from evertwin.engineering.compile import ModelPlan, compile_model
from evertwin.engineering.engineered import twin_text
from evertwin.engineering.study import Study, modelled, study
from evertwin.errors import ConfigError, DataError
from evertwin.files import write_whole
from evertwin.loop.configured_model import model_of
from evertwin.loop.feed import Data, Feed
from evertwin.loop.setup import Setup
from evertwin.loop.versions import Versions
from evertwin.loop.work import Work
from evertwin.machines.catalog import with_files
from evertwin.settings.document import Document
from evertwin.tuning import Problem

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
