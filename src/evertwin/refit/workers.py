"""What a twin's slow work needs in another process: built there from its twin file, once.

Plain data travels, models never: each process builds the model from the twin file and keeps it.

>>> from evertwin.config.spec import ModelSpec
>>> spec = TwinSpec("robot", ModelSpec("robot1d"))
>>> setup_of(spec) is setup_of(spec), built(spec, Form()).parameters.names
(True, ('gain',))
"""

from __future__ import annotations

from dataclasses import fields
from functools import partial

from evertwin.config.spec import TwinSpec
from evertwin.engine import Engine
from evertwin.models import Model
from evertwin.models.corrected.corrected import build
from evertwin.models.form import Form
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.tuning import Far

KEPT = 4
"""Twins that a process keeps."""
_SETUPS: dict[str, Setup] = {}


def _key(spec: TwinSpec, form: Form | None = None) -> str:
    """All that a twin file says, and a form."""
    return repr(([getattr(spec, one.name) for one in fields(spec)], form))


def setup_of(spec: TwinSpec) -> Setup:
    """A twin's frozen parts, which this process builds once."""
    key = _key(spec)
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
    return Far(engine.map, partial(built, spec, form), _key(spec, form), engine.workers)


def formed(far: Far | None, spec: TwinSpec, form: Form) -> Far | None:
    """The same processes, for the model in another form."""
    build, key = partial(built, spec, form), _key(spec, form)
    return None if far is None else far._replace(build=build, key=key)
