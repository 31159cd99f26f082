"""The detectors of a twin over released rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from evertwin.config.spec import TwinSpec
from evertwin.models import Model
from evertwin.twin.settle import Released

__all__ = ["Alarm", "Detect"]


class Alarm(NamedTuple):
    kind: str
    signal: str
    reason: str
    evidence: dict[str, Any]


@dataclass(frozen=True)
class Detect:
    @classmethod
    def of(cls, spec: TwinSpec, model: Model) -> "Detect":
        return cls()

    def init(self) -> tuple[Any, ...]:
        return ()

    def step(self, state: Any, rows: Released) -> Any:
        return state

    def alarm(self, state: Any) -> Alarm | None:
        return None
