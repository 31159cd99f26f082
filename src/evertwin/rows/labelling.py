"""The labels of a twin file, and what they are watched by.

>>> import tempfile
>>> from evertwin.config.spec import LabelsSpec, ModelSpec
>>> from evertwin.sources.spec import ArraySpec
>>> folder = tempfile.mkdtemp()
>>> _ = (Path(folder) / "known.csv").write_text("truth,label\\nbox,box\\nbox,table\\n")
>>> spec = TwinSpec("base", ModelSpec("differential"), array=(ArraySpec("said", (3,)),),
...                 labels=LabelsSpec("said", "known.csv"), folder=folder)
>>> watched(spec).known.classes
('box', 'table')
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evertwin.config import TwinSpec, place
from evertwin.errors import ConfigError, DataError, naming
from evertwin.features.images.confusion_drift import ConfusionDrift
from evertwin.features.images.labelled import Labelled, read_alone
from evertwin.settings.notes import expand


def watched(spec: TwinSpec) -> ConfusionDrift | None:
    """The stage that ``[labels]`` asks for; None: there is no such section.

    Raises:
        ConfigError: the known labels cannot be read, have a class that is not named, or groups
            where those that come have none.
    """
    rule = spec.labels
    if rule is None:
        return None
    where = place(spec, ("labels", "known"))
    with naming(where, DataError, ConfigError):
        known = read_alone(Path(spec.folder) / expand(rule.known))
    if rule.classes:
        known = _named(known, rule.classes, where)
    shape = next(one.shape for one in spec.array if one.name == rule.source)
    if (known.group is not None) != (shape == (4,)):
        raise ConfigError(
            f"{where}: expected a column 'group' where labels are of shape [4], and none where "
            f"they are of [3], got shape {[*shape]}"
        )
    return ConfusionDrift(rule.source, known, rule.per)


def _named(known: Labelled, classes: tuple[str, ...], where: str) -> Labelled:
    """The same rows, their classes in the order of the twin file."""
    others = [name for name in known.classes if name not in classes]
    if others:
        raise ConfigError(f"{where}: expected the classes {', '.join(classes)}, got {others[0]}")
    order = np.array([classes.index(name) for name in known.classes], dtype=np.int64)
    return Labelled(
        classes, order[known.truth], order[known.label], known.simulated, known.probability,
        known.group,
    )  # fmt: skip
