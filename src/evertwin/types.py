"""Letters and array types, declared once.

``t`` time [ns], ``dt`` interval [s], ``x`` state, ``u`` input, ``y`` output, ``p`` parameters,
``r`` residual; sizes ``nx nu ny np``, ``n`` rows. SI units inside.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8

__all__ = [
    "Bools",
    "Inputs",
    "Intervals",
    "Json",
    "Marks",
    "OutputRuns",
    "Outputs",
    "ParameterVector",
    "ParameterVectors",
    "Stamps",
    "StateVector",
    "StateVectors",
    "Tasks",
    "Vector",
]

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
OutputRuns: TypeAlias = Float64[np.ndarray, "k n ny"]
Vector: TypeAlias = Float64[np.ndarray, " k"]

if TYPE_CHECKING:
    Json: TypeAlias = (
        "bool | int | float | str | tuple[Json, ...] | list[Json] | Mapping[str, Json] | None"
    )
else:
    Json = object  # run-time checkers cannot follow a recursive alias
