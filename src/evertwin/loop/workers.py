"""A fit's roll-outs in processes of their own: for models whose rows hold the interpreter.

Each process builds the model anew from the twin file, so that only plain data travels.

>>> from evertwin.config.spec import ModelSpec
>>> built(TwinSpec("robot", ModelSpec("robot1d")), Form()).parameters.names
('gain',)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from evertwin.config.spec import TwinSpec
from evertwin.engine import Pool
from evertwin.loop.configured_model import model_of
from evertwin.models import Model
from evertwin.models.corrected import build
from evertwin.models.form import Form
from evertwin.tuning import Far

__all__ = ["built", "formed", "processes"]


def built(spec: TwinSpec, form: Form) -> Model:
    """The model of a twin file in a form."""
    return build(model_of(spec), form)


def formed(far: Far | None, spec: TwinSpec, form: Form) -> Far | None:
    """The same processes, for the model in another form."""
    return None if far is None else far._replace(build=partial(built, spec, form), key=repr(form))


@contextmanager
def processes(spec: TwinSpec, form: Form, workers: int) -> Iterator[Far | None]:
    """Where differences are simulated: None with one worker, which is this process."""
    if workers == 1:
        yield None
        return
    with Pool(workers=workers) as pool:
        yield formed(Far(pool.map, partial(built, spec, form), "", workers), spec, form)
