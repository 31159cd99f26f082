"""Models written in Modelica: compiled to equations by rumoca, solved and stepped here.

`Modelica` is the model. The way of a file: `compiler` (a process with limits) → `reader` (scalar
equations over one `graph`) → `reduce` and `solve` (slopes of the states) → `tape` → `kernel`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.models.modelica.compiler import Limits as Limits, equations as equations
    from evertwin.models.modelica.model import LIBRARY as LIBRARY, Modelica as Modelica

__getattr__ = surface(__name__)
