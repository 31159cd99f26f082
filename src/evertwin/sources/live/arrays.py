"""Lists of numbers that a machine says → chunks of arrays, as the twin file's ``[[array]]`` says.

They are stored as they come, without a unit; null is not a number.

>>> from evertwin.sources.live.telling import Telling
>>> from evertwin.sources.spec import ArraySpec, TimeSpec
>>> spec = ArraySpec("scan", (2, 2), column="ranges", time=TimeSpec("t", "s"))
>>> decoder = decoder_of(spec, Telling("scan"))
>>> [chunk.v.tolist() for chunk in decoder.chunks({"t": 0.5, "ranges": [1, 2.5, 3, 4]})]
[[[[1.0, 2.5], [3.0, 4.0]]]]
>>> decoder.chunks({"t": 0.7, "ranges": [1, 2]}), dict(decoder.told.health.rejected)
([], {'expected 4 numbers in ranges': 1})
"""

from __future__ import annotations

import math

import numpy as np

from evertwin.sources.live.contract import LiveSettings
from evertwin.sources.live.decode import Columns, Decoder
from evertwin.sources.live.telling import Telling
from evertwin.sources.spec import ArraySpec, ChannelSpec, SourceSpec


class ArrayDecoder(Decoder):
    """The decoder of one source of arrays.

    >>> ArrayDecoder(ArraySpec("scan", (180,), column="ranges"), Telling("scan")).names
    ('ranges', 't')
    """

    def __init__(
        self, spec: ArraySpec, told: Telling, settings: LiveSettings | None = None,
        *, arrives: bool = True,
    ) -> None:  # fmt: skip
        channels = {spec.column: ChannelSpec(spec.column, "1")}
        super().__init__(
            SourceSpec(spec.name, channels, time=spec.time), told, settings, arrives=arrives
        )
        self._column, self._shape = spec.column, spec.shape

    def _values(self, columns: Columns) -> np.ndarray | None:
        said, count = columns.get(self._column), math.prod(self._shape)
        try:
            values = np.array(said if isinstance(said, list) else (), dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            values = np.zeros(0)
        if values.shape != (count,):
            self.told.reject(f"expected {count} numbers in {self._column}")
            return None
        return values.reshape(self._shape)

    def _si(self, raw: np.ndarray) -> np.ndarray:
        return raw


def decoder_of(
    spec: SourceSpec | ArraySpec, told: Telling, settings: LiveSettings | None = None,
    *, arrives: bool = True,
) -> Decoder:  # fmt: skip
    """The decoder of a source of rows, or of arrays."""
    if isinstance(spec, ArraySpec):
        return ArrayDecoder(spec, told, settings, arrives=arrives)
    return Decoder(spec, told, settings, arrives=arrives)
