"""The model out again: as data, for MATLAB, as a robot description, and back.

* `content`: what is exported: form, parameters with intervals, trajectories;
* `text`: JSON, ``schema: "evertwin.model/1"``;
* `matlab`: MAT version 5, by scipy.io;
* `aas`: an asset administration shell, by basyx-python-sdk;
* `robot`: URDF with the inertias as tuned;
* `formats`: the registry; another room adds a writer by one entry;
* `back`: parameter values of a JSON or MAT file, to become a version.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.export.back import values_in as values_in
    from evertwin.export.content import Exported as Exported, exported as exported
    from evertwin.export.formats import FORMATS as FORMATS, Written as Written, write as write

__getattr__ = surface(__name__)
