"""One form for all rows, or another machine since some row.

A form that is wrong at some commands alone looks like another machine when these come. So what is
found on the rows since then is tried on those before, and beside what is found on all of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evertwin.fold import Windows
from evertwin.gauges.changes.change import PART
from evertwin.ledger.versions import Versions
from evertwin.models import Model
from evertwin.models.form import Version
from evertwin.refit.answer_events import changed_since
from evertwin.refit.rows.newest import CLEARLY
from evertwin.setup.evaluation import left
from evertwin.setup.setup import Setup
from evertwin.types import ParameterVector, Vector


def made(
    versions: Versions, version: Version, found: dict[str, Any]
) -> tuple[Model, ParameterVector]:
    """The model of a candidate for a version, and its parameters."""
    model = versions.model_of(found["form"])
    own = dict(zip(version.names, version.values, strict=True)) | found["values"]
    names = model.parameters.names
    return model, model.parameters.with_values({n: own[n] for n in names if n in own}).values


def plainer(
    setup: Setup, versions: Versions, version: Version, rows: tuple[Windows, Windows, Windows],
    contents: tuple[dict[str, Any], dict[str, Any]],
) -> dict[str, Any]:  # fmt: skip
    """What the newest rows tell, where it holds for the rows before, too; what all rows tell, where
    that is hardly farther from the newest; else the former, with the word that the machine changed.

    Args:
        rows: those before, the newest, which seem to be of another machine, and those before all.
        contents: of the answers to the newest and to all of them.
    """
    (old, new, known), (newest, both) = rows, contents

    def off(content: dict[str, Any], some: Windows) -> Vector:
        return left(setup, *made(versions, version, content["candidate"]), some, known)

    was = left(setup, versions.model_of(version.form), version.p, old, known)
    if np.nanmean(np.square(off(newest, old) / was)) <= 1.0 + PART:
        return newest
    share = np.square(off(newest, new) / off(both, new)) if both["candidate"] else np.zeros(1)
    if np.nanmean(share) > 1.0 - CLEARLY:
        return both
    newest["events"].insert(0, changed_since(new))
    return newest | {"since": new[0].row}
