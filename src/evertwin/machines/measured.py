"""A measured table from a file: any kind of recording that can be read, in any unit.

    [model]
    kind = "table"
    options = { file = "pump.csv", inputs = { speed = "rpm" }, outputs = { flow = "l/min" } }

>>> import tempfile
>>> file = Path(tempfile.mkdtemp()) / "pump.csv"
>>> _ = file.write_text("speed,flow\\n0,0\\n3000,60\\n")
>>> pump = measured_table(str(file), {"speed": "rpm"}, {"flow": "l/min"})
>>> pump.inputs.units, pump.values.ravel().round(4).tolist()
(('rad/s',), [0.0, 0.001])
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from evertwin.errors import DataError, UsageError, naming
from evertwin.models.tables.table import TableModel
from evertwin.signals.units import si_unit, to_si
from evertwin.sources import open_recording

Columns: TypeAlias = Mapping[str, str] | Sequence[str]
"""Names of columns with their units; without units, as the file states them."""


def measured_table(
    file: str, inputs: Columns, outputs: Columns, beyond: str = "hold"
) -> TableModel:
    """The table in ``file``.

    Args:
        file: CSV, MAT, Parquet or NumPy; several rows of the same inputs are averaged.
        inputs: columns that go in, with their units.
        outputs: columns that come out, with their units.
        beyond: outside the measured range: ``hold`` the edge, go on in a straight ``line``, or
            ``error``.

    Raises:
        DataError: the file cannot be read, lacks a column, or its columns form no table.
        UsageError: no column is named, or a unit is not known.
    """
    if isinstance(inputs, str) or isinstance(outputs, str):
        raise UsageError("table: expected lists of columns, or columns with units, got a text")
    units: dict[str, str] = {}
    found = [{name: _read(file, name, said, units) for name in said} for said in (inputs, outputs)]
    with naming(f"{Path(file).name}", DataError, DataError):
        return TableModel.of(found[0], found[1], units, beyond)


def _read(file: str, name: str, said: Columns, units: dict[str, str]) -> list[float]:
    """One column in SI; notes its unit."""
    table, column = open_recording(file).find(name)
    unit = (said[name] if isinstance(said, Mapping) else "") or column.unit or "1"
    units[name] = si_unit(unit)
    parts = [rows.values[:, 0] for rows in table.rows([name], None)]
    values = np.concatenate(parts) if parts else np.zeros(0)
    return list(map(float, to_si(values, unit)))
