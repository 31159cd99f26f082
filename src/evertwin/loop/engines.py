"""Where a twin's slow work runs: in this process, or in warm ones of its own.

>>> from evertwin.config.spec import ModelSpec
>>> Engines(TwinSpec("robot", ModelSpec("robot1d"))).of(None).workers
0
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import evertwin.engine as engine
import evertwin.refit as refit
from evertwin.config.spec import TwinSpec
from evertwin.engine.contract import Engine
from evertwin.engine.spec import EngineSpec
from evertwin.errors import UsageError


class Engines:
    """The engines of one twin, one per number of workers; all stay warm until they are closed."""

    def __init__(self, spec: TwinSpec, given: bool = False, own: Engine | None = None) -> None:
        """``given``: was the model an object, and not named by the twin file? ``own``: the engine
        for as many workers as the twin file says."""
        self.spec = spec
        self.given = given
        self._engines: dict[int, Engine] = {} if own is None else {spec.engine.workers: own}

    def of(self, workers: int | None) -> Engine:
        """In this process (0), in as many of its own, or as the twin file says (None).

        Raises:
            UsageError: too many, less than none, or any for a model that cannot travel.
        """
        rule = self.spec.engine if workers is None else replace(self.spec.engine, workers=workers)
        if rule.workers and self.given:
            raise UsageError(
                "workers: expected a model that the twin file names, since each process builds it "
                'anew, got an object: put it into a Python file (kind = "python")'
            )
        if rule.workers not in self._engines:
            started = self._started(rule) if rule.workers else engine.InProcess()
            self._engines[rule.workers] = started
        return self._engines[rule.workers]

    def _started(self, rule: EngineSpec) -> Engine:
        # each room's files are loaded when they are asked for: a twin that only shows needs neither
        return engine.Pool(rule.workers, rule, partial(refit.work_of, self.spec, None))

    def close(self) -> None:
        """Ends the processes."""
        for one in self._engines.values():
            one.close()
