"""Why rows of a user's model failed: what its step raised first.

A step that is called from compiled code cannot raise. Its row becomes an error (NaN), and its
kernel keeps what came first since it was last told to `forget`.

>>> from evertwin.models.functions.function import FunctionModel
>>> def step(x, u, dt, p):
...     raise ValueError("the table ends at 0.7")
>>> model = FunctionModel(step, Layout.of(v="m/s"), Layout.of(y="m"))
>>> try:
...     model.simulate(np.zeros(0), np.ones((1, 1)), np.ones(1), np.zeros(0))
... except ModelError as error:
...     print(str(error).partition(" (")[0])
the model's step raised ValueError: the table ends at 0.7
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from evertwin.errors import ModelError
from evertwin.models.kernels.kernel import Kernel
from evertwin.signals.channels import Layout
from evertwin.types import Json, Vector

MOST = 6
"""Inputs of a row that are named."""
HUGE = 1e100
"""State from which on a simulation has run away: what follows from it says nothing of the step."""


class Failures(NamedTuple):
    """What a kernel knows of the first row that failed.

    >>> Failures(lambda: "", lambda: None).why()
    ''
    """

    why: Callable[[], str]
    """What was raised, and the inputs at which; empty where nothing was."""
    forget: Callable[[], None]


class Failed(NamedTuple):
    """Rows that a model could not compute.

    >>> str(Failed(130, 399, 41, "the model's step raised ValueError: ends at 0.7"))
    "the model's step raised ValueError: ends at 0.7, on 130 of 399 rows, first at row 41"
    """

    rows: int
    of: int
    """Rows that it was asked for."""
    first: int
    why: str

    @property
    def all(self) -> bool:
        """Is there none that it could compute?"""
        return self.rows == self.of

    @classmethod
    def together(cls, some: Iterable[Failed | None]) -> Failed | None:
        """Those of several recordings."""
        known = [one for one in some if one is not None]
        sums = (sum(one.rows for one in known), sum(one.of for one in known))
        return cls(*sums, known[0].first, known[0].why) if known else None

    def to_dict(self) -> dict[str, Json]:
        """Plain content."""
        return {"rows": self.rows, "of": self.of, "first": self.first, "reason": self.why}

    def __str__(self) -> str:
        count = f"all {self.of}" if self.all else f"{self.rows} of {self.of}"
        return f"{self.why}, on {count} rows, first at row {self.first}"


def failures_in(kept: Any) -> Iterator[Failures]:
    """Those of the models inside a kernel."""
    if isinstance(kept, Failures):
        yield kept
        return
    inner = kept.keep if isinstance(kept, Kernel) else kept
    for one in inner if isinstance(inner, tuple) else ():
        yield from failures_in(one)


def raised(step: Any, error: Exception) -> ModelError:
    """The error that says what a user's step raised, with the line of its file."""
    frames = traceback.extract_tb(error.__traceback__)
    said = str(error).partition("\n")[0]
    told = f"{type(error).__name__}{': ' * bool(said)}{said}"
    return ModelError(f"the model's step raised {told}{_place(step, frames)}")


def check_numbers(step: Any, before: Sequence[Any], given: Sequence[tuple[Layout, Any]]) -> None:
    """Does a step give numbers, from numbers of which none has run away?

    Args:
        before: states, inputs and parameters of the row.
        given: what follows from them, with its names.

    Raises:
        ModelError: it gives NaN; names for what, with the file of the step.
    """
    lost = [one.name for of, values in given for one, v in zip(of, values, strict=True) if v != v]
    if lost and all((np.abs(values) < HUGE).all() for values in before):
        names = ", ".join(dict.fromkeys(lost))
        said = f"the model's step gives no number (NaN) for {names}{_place(step)}"
        raise ModelError(said) from FloatingPointError("no number")  # of this row, no mistake


def _place(step: Any, frames: Sequence[traceback.FrameSummary] = ()) -> str:
    """File and line of a step, or of the last of the frames in it."""
    function = getattr(step, "func", step)
    code = getattr(function, "__code__", None) or getattr(type(function).__call__, "__code__", None)
    file = "" if code is None else code.co_filename
    inside = [one for one in frames if one.filename == file]
    line = inside[-1].lineno if inside else getattr(code, "co_firstlineno", 0)
    return f" ({file.rsplit('/', 1)[-1]}:{line})" if file else ""


def at_inputs(error: Exception, inputs: Layout, u: Vector) -> str:
    """The error, with the inputs of its row."""
    values = zip(inputs, np.asarray(inputs.to_stated(u)).tolist(), strict=True)
    told = [
        f"{one.name} = {value:.4g} {one.stated or one.unit}".removesuffix(" 1")
        for one, value in values
    ]
    more = ", …" * (len(told) > MOST)
    return f"{error}{' at ' * bool(told)}{', '.join(told[:MOST])}{more}"
