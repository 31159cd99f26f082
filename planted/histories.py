"""Lives as a twin tells them from tables: `Twin.life` on `twins/wear.toml`."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from evertwin import Twin
from evertwin.prognosis.laws import Life, NotEnough
from evertwin.prognosis.outlook.lives import ComponentLife
from planted.lives import Planted
from planted.twins import shipped, written

Columns = Mapping[str, np.ndarray]


def until(columns: Columns, at: float, clock: str = "cycle") -> Columns:
    """The rows up to a moment."""
    known = columns[clock] <= at
    return {name: column[known] for name, column in columns.items()}


def table(series: Planted, cut: float = np.inf) -> Columns:
    """What is known of a planted series at a share of its life: it was new at cycle 0."""
    done = np.array(["part: replaced", *[""] * len(series.at)])
    whole = {
        "cycle": np.r_[0.0, series.at], "wear": np.r_[np.nan, series.value], "maintenance": done
    }  # fmt: skip
    return until(whole, cut * series.life * (1.0 + 1e-12))


class Told:
    """A twin that is asked for lives, with or without a fleet of like machines.

    >>> with Told() as twin:
    ...     isinstance(twin.life({"cycle": np.arange(9.0), "wear": np.arange(9.0) / 30}), Life)
    True
    """

    def __init__(
        self, fleet: Sequence[Columns] = (), clock: str = "cycle", *, failed: bool = False,
        **indicator: Any,
    ) -> None:  # fmt: skip
        self.folder = tempfile.TemporaryDirectory()
        files = tuple(str(self._write(f"like{k}", one)) for k, one in enumerate(fleet))
        likes = {"failed" if failed else "fleet": files}
        spec = shipped("wear", prognosis={**likes, "clock": clock})
        rules = (replace(spec.indicator[0], **indicator),)
        self.twin = Twin(replace(spec, indicator=rules))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self.twin.close()
        self.folder.cleanup()

    def _write(self, name: str, columns: Columns) -> Path:
        return written(Path(self.folder.name) / f"{name}.csv", columns)

    def component(self, columns: Columns) -> ComponentLife:
        """All that is told of the part."""
        return self.twin.life(self._write("history", columns)).components["part"]

    def life(self, columns: Columns) -> Life | NotEnough:
        """What is left of its life, from the last row on."""
        return self.component(columns).life
