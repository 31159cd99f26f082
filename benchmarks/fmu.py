"""An FMU in its child process against the same FMPy loop in this process, per row.

    python -m benchmarks.fmu

Every row sets the inputs, steps and reads the outputs. Here: FMPy's raw calls (``fmi2SetReal``,
``fmi2DoStep``, ``fmi2GetReal``, and their like of FMI 3) with arrays made once, the state going on
from row to row. There: `Fmu.simulate` over blocks, the state handed over at each. The FMUs are one
mass with friction in C, where the calls cost most of the time, and the same in Python (PythonFMU),
where the model does. Needs a C compiler. Ends with 1 where a block of 1,000 rows or more takes over
1.5 times as long.
"""

from __future__ import annotations

import ctypes
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from evertwin.models.fmu import Fmu, fmu
from tests.models.fmu.native import build
from tests.models.fmu.python_fmu import build as build_python

LIMIT = 1.5
BLOCKS = (1, 10, 100, 1_000, 10_000)
REPEATS = 7
STEP = 0.01


def forces(rows: int) -> np.ndarray:
    """Inputs, (n, 1)."""
    return np.asarray(4.0 * np.sin(0.02 * np.arange(rows))[:, None])


class Loop:
    """The same FMU, in this process."""

    def __init__(self, file: Path, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
        description = fmpy.read_model_description(str(file))
        numbers = {v.name: v.valueReference for v in description.modelVariables}
        self.three = description.fmiVersion.startswith("3")
        kind: Any = FMU3Slave if self.three else FMU2Slave
        self.fmu: Any = kind(
            guid=description.guid, unzipDirectory=fmpy.extract(str(file)),
            modelIdentifier=description.coSimulation.modelIdentifier, instanceName="loop",
        )  # fmt: skip
        self.fmu.instantiate()
        if not self.three:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.u = (ctypes.c_uint * len(inputs))(*(numbers[n] for n in inputs))
        self.y = (ctypes.c_uint * len(outputs))(*(numbers[n] for n in outputs))

    def run(self, u: np.ndarray) -> np.ndarray:
        """Outputs of all rows."""
        return self._run3(u) if self.three else self._run2(u)

    def _run2(self, u: np.ndarray) -> np.ndarray:
        fmu, c = self.fmu, self.fmu.component
        value, out = (ctypes.c_double * len(self.u))(), (ctypes.c_double * len(self.y))()
        rows = np.empty((len(u), len(self.y)))
        for i in range(len(u)):
            value[:] = u[i]
            fmu.fmi2SetReal(c, self.u, len(self.u), value)
            fmu.fmi2DoStep(c, i * STEP, STEP, 1)
            fmu.fmi2GetReal(c, self.y, len(self.y), out)
            rows[i] = out
        return rows

    def _run3(self, u: np.ndarray) -> np.ndarray:
        fmu, c = self.fmu, self.fmu.component
        value, out = (ctypes.c_double * len(self.u))(), (ctypes.c_double * len(self.y))()
        event, end, early = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool()
        last = ctypes.c_double()
        flags = [ctypes.byref(flag) for flag in (event, end, early, last)]
        rows = np.empty((len(u), len(self.y)))
        for i in range(len(u)):
            value[:] = u[i]
            fmu.fmi3SetFloat64(c, self.u, len(self.u), value, len(value))
            fmu.fmi3DoStep(c, i * STEP, STEP, True, *flags)
            fmu.fmi3GetFloat64(c, self.y, len(self.y), out, len(out))
            rows[i] = out
        return rows


def in_blocks(model: Fmu, u: np.ndarray, size: int) -> np.ndarray:
    """Outputs of all rows, block by block."""
    p = model.parameters.values
    x, parts, dt = model.initial(p), [], np.full(size, STEP)
    for start in range(0, len(u), size):
        x, y = model.simulate(x, u[start : start + size], dt, p)
        parts.append(y)
    return np.concatenate(parts)


def seconds(work: Callable[[], object]) -> float:
    """Wall time, the best of some: other work on the machine only adds to it."""
    took = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        took.append(time.perf_counter() - began)
    return min(took)


def compare(name: str, file: Path, options: dict[str, Any], most: int) -> bool:
    """Prints one table; True if the limit holds."""
    model = fmu(file, **options)
    u = forces(most)
    loop = Loop(file, model.inputs.names, model.outputs.names)
    difference = np.abs(loop.run(u[:200]) - in_blocks(model, u[:200], 50)).max()
    here = seconds(lambda: loop.run(u)) / most
    print(f"{name}: FMPy in this process {1e6 * here:.2f} us/row; outputs differ {difference:.1e}")
    good = bool(difference < 1e-9)
    for size in BLOCKS:
        rows = min(most, max(200, size * 4)) // size * size
        if not rows:
            continue
        part = u[:rows]
        there = seconds(lambda part=part, size=size: in_blocks(model, part, size)) / rows  # type: ignore[misc]
        ratio = there / here
        good = good and (size < 1_000 or ratio <= LIMIT)
        print(f"  blocks of {size:6d}: child {1e6 * there:8.2f} us/row, ratio {ratio:7.3f}")
    model.close()
    return good


def main() -> int:
    """Exit code 0 if the limit holds everywhere."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        results = [
            compare("C, FMI 2", build(root / "two"), {}, 40_000),
            compare("C, FMI 3", build(root / "three", three=True), {}, 40_000),
            compare("PythonFMU, FMI 2", build_python(root / "python"),
                    {"states": ["x", "v"]}, 4_000),
        ]  # fmt: skip
    print(f"limit {LIMIT} at 1,000 rows and more: {'held' if all(results) else 'NOT HELD'}")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
