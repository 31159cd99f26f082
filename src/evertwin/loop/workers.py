"""What a twin's slow work needs in another process: built there from its twin file, once.

Plain data travels, models never: each process builds the model from the twin file and keeps it.

>>> from evertwin.config.spec import ModelSpec
>>> spec = TwinSpec("robot", ModelSpec("robot1d"))
>>> setup_of(spec) is setup_of(spec), built(spec, Form()).parameters.names
(True, ('gain',))
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from evertwin.config.spec import TwinSpec
from evertwin.engine import Engine, InProcess, Pool
from evertwin.errors import UsageError
from evertwin.loop.configured_model import model_of
from evertwin.loop.setup import Setup
from evertwin.models import Model
from evertwin.models.corrected import build
from evertwin.models.form import Form
from evertwin.tuning import Far

__all__ = ["Engines", "built", "far_of", "formed", "setup_of"]

KEPT = 4
"""Twins that a process keeps."""
_SETUPS: dict[str, Setup] = {}


class Engines:
    """Where a twin's slow work runs; processes stay warm until they are closed.

    >>> from evertwin.config.spec import ModelSpec
    >>> Engines(TwinSpec("robot", ModelSpec("robot1d"))).of(None).workers
    0
    """

    def __init__(self, spec: TwinSpec, given: bool = False) -> None:
        """``given``: was the model an object, and not named by the twin file?"""
        self.spec = spec
        self.given = given
        self._engine: Engine = InProcess()

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
        if rule.workers != self._engine.workers:
            self._engine.close()
            warm = partial(setup_of, self.spec)
            self._engine = Pool(rule.workers, rule, warm) if rule.workers else InProcess()
        return self._engine

    def close(self) -> None:
        """Ends the processes."""
        self._engine.close()


def setup_of(spec: TwinSpec) -> Setup:
    """A twin's frozen parts, which this process builds once."""
    key = repr(spec)
    if key not in _SETUPS:
        if len(_SETUPS) >= KEPT:
            _SETUPS.clear()
        _SETUPS[key] = Setup(spec, model_of(spec))
    return _SETUPS[key]


def built(spec: TwinSpec, form: Form) -> Model:
    """The model of a twin file in a form."""
    return build(setup_of(spec).model, form)


def far_of(engine: Engine, spec: TwinSpec, form: Form) -> Far | None:
    """Where a fit's differences are simulated; None: in this process."""
    if engine.workers == 0:
        return None
    return Far(engine.map, partial(built, spec, form), repr((spec, form)), engine.workers)


def formed(far: Far | None, spec: TwinSpec, form: Form) -> Far | None:
    """The same processes, for the model in another form."""
    build, key = partial(built, spec, form), repr((spec, form))
    return None if far is None else far._replace(build=build, key=key)
