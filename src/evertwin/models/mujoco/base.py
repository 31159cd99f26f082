"""What roll-outs and inverse dynamics have in common: the file, its parameters, the engines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from evertwin.models.mujoco.guard import Source, read_file, read_text
from evertwin.models.mujoco.knobs import Knob
from evertwin.models.mujoco.pool import EnginePool
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout


@dataclass(frozen=True, eq=False)
class FromFile(ABC):
    """Base of models read from MJCF or URDF.

    >>> FromFile.__name__
    'FromFile'
    """

    source: Source
    compiled: Any
    """MuJoCo's compiled model, never changed."""
    knobs: tuple[Knob, ...]
    """What the parameters are in the compiled model."""
    inputs: Layout
    outputs: Layout
    parameters: Parameters
    threads: int
    """Threads of `simulate_batch`; 0: one for each processor."""

    @classmethod
    def of(cls, file: str | Path, **options: Any) -> Self:
        """The model in a file; what it names (meshes, includes) must lie in its folder.

        Raises:
            ModelError: the file is refused, by us or by MuJoCo, or holds what the model cannot be.
            UsageError: an option does not fit the model.
        """
        return cls.built(read_file(file), **options)

    @classmethod
    def from_text(cls, text: str, **options: Any) -> Self:
        """The same from XML at hand."""
        return cls.built(read_text(text), **options)

    @classmethod
    @abstractmethod
    def built(cls, source: Source, **options: Any) -> Self:
        """The model of a checked source; says which options there are."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out of the file."""
        return self.source.notes

    def __getstate__(self) -> dict[str, Any]:
        """Without the engines: they belong to this process."""
        return {key: value for key, value in self.__dict__.items() if key != "_engines"}

    @cached_property
    def _engines(self) -> EnginePool:
        return EnginePool(self.compiled, self.knobs, self.threads)
