"""Letters and array types, declared once.

``t`` time [ns], ``dt`` interval [s], ``x`` state, ``u`` input, ``y`` output, ``p`` parameters,
``r`` residual; sizes ``nx nu ny np``, ``n`` rows. SI units inside.

Shapes are written with jaxtyping and checked in tests, which load it first. Elsewhere it is not
needed, and an array type is `numpy.ndarray`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool as Bool
    from jaxtyping import Float64 as Float64
    from jaxtyping import Int32 as Int32
    from jaxtyping import Int64 as Int64
    from jaxtyping import UInt8 as UInt8
else:

    class _Array:
        def __class_getitem__(cls, item: tuple[type, str]) -> type:
            return item[0]

    Bool = Float64 = Int32 = Int64 = UInt8 = _Array

Stamps: TypeAlias = Int64[np.ndarray, " n"]
Intervals: TypeAlias = Float64[np.ndarray, " n"]
Tasks: TypeAlias = Int64[np.ndarray, " n"]
Bools: TypeAlias = Bool[np.ndarray, " n"]
Inputs: TypeAlias = Float64[np.ndarray, "n nu"]
Outputs: TypeAlias = Float64[np.ndarray, "n ny"]
Marks: TypeAlias = UInt8[np.ndarray, "n nm"]
StateVector: TypeAlias = Float64[np.ndarray, " nx"]
ParameterVector: TypeAlias = Float64[np.ndarray, " np"]
StateVectors: TypeAlias = Float64[np.ndarray, "k nx"]
ParameterVectors: TypeAlias = Float64[np.ndarray, "k np"]
Rollout: TypeAlias = tuple[StateVector, Outputs]
"""State after the last row, and the outputs of every row."""
OutputRuns: TypeAlias = Float64[np.ndarray, "k n ny"]
Vector: TypeAlias = Float64[np.ndarray, " k"]
PerOutput: TypeAlias = Float64[np.ndarray, " ny"]

if TYPE_CHECKING:
    Json: TypeAlias = (
        "bool | int | float | str | tuple[Json, ...] | list[Json] | Mapping[str, Json] | None"
    )
else:
    Json = object  # run-time checkers cannot follow a recursive alias
