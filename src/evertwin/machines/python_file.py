"""A model that somebody built in a Python file of their own, by the file's and its name.

The file runs with the rights of this process: it is code, not data.
"""

from __future__ import annotations

import importlib.util
import traceback
from pathlib import Path

import numpy as np

from evertwin.errors import ConfigError, ModelError, UsageError
from evertwin.models import Model

_MISTAKES = (NameError, TypeError, AttributeError, LookupError)


def model_from_file(file: str = "", name: str = "model") -> Model:
    """The Model called ``name`` in a Python file; a plain step runs as machine code if it can.

    Raises:
        ConfigError: there is no such file, no such model in it, or it asks for what there is not.
        ModelError: its code fails, at once or on one row.
    """
    path = Path(file)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ConfigError(f"[model] options: no Python file {path.name!r} beside the twin file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # it is the user's code
        raise _mistaken(path.name, error) from error
    found = getattr(module, name, None)
    if not isinstance(found, Model):
        models = [key for key, value in vars(module).items() if isinstance(value, Model)]
        there = f"there are {', '.join(models)}" if models else "it makes no model"
        raise ConfigError(f"{path.name}: expected a model called {name!r}; {there}")
    _tried(path.name, found)
    return found


def _mistaken(file: str, error: BaseException) -> ConfigError | ModelError:
    """What is wrong in the code, with its line."""
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if file in f.filename]
    if isinstance(error, SyntaxError):
        lines, error = [error.lineno], SyntaxError(error.msg)
    place = f"{file}:{lines[-1]}" if lines else file
    kind = ConfigError if isinstance(error, UsageError) else ModelError
    return kind(f"{place}: {type(error).__name__}: {error}: correct the model")


def _tried(file: str, model: Model) -> None:
    """Runs one row of zeros: a mistake in the code is told now, not as a lost row later."""
    p, u = model.parameters.values, model.inputs.from_stated(np.zeros((1, len(model.inputs))))
    try:
        with np.errstate(all="ignore"):  # a row without inputs may be none of the machine's
            model.simulate(model.initial(p), u, np.ones(1), p)
    except Exception as error:  # it is the user's code
        cause = error.__cause__ if isinstance(error, ModelError) else error
        if cause is None or isinstance(cause, _MISTAKES):
            raise _mistaken(file, cause or error) from error
        # else zeros may be no values that this machine can have: rows that fail are told later
