"""The flat model: scalar variables, parameters and equations over one graph of expressions."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from evertwin.models.modelica.graph import Graph


class Variable(NamedTuple):
    """A scalar variable of the flat model, or a parameter that tuning may change.

    >>> Variable("v", 3, "1").output
    False
    """

    name: str
    leaf: int
    unit: str
    low: float = -math.inf
    high: float = math.inf
    start: int | None = None
    """Node of the start value; None where the model gives none."""
    output: bool = False
    """Declared as an output of the model."""
    place: str = ""
    """File and line of its declaration."""
    text: str = ""
    """Its description."""


class Equation(NamedTuple):
    """An expression that is zero.

    >>> Equation(0, "M.mo:3").place
    'M.mo:3'
    """

    node: int
    place: str


class Flat(NamedTuple):
    """All of a flat model.

    >>> Flat("M", Graph()).equations
    ()
    """

    name: str
    graph: Graph
    unknowns: tuple[Variable, ...] = ()
    """States, algebraic variables and outputs."""
    inputs: tuple[Variable, ...] = ()
    parameters: tuple[Variable, ...] = ()
    equations: tuple[Equation, ...] = ()
    initial: tuple[Equation, ...] = ()
    """Hold at the start."""
    notes: tuple[str, ...] = ()
    """Where the equations switch: steps do not stop there."""


def label(name: str, index: tuple[int, ...] = ()) -> str:
    """A variable's name without brackets, since patterns of names give those a meaning.

    >>> label("joint[2].q"), label("M", (2, 1))
    ('joint2.q', 'M2_1')
    """
    plain = re.sub(r"\[([^\]]*)\]", lambda found: found[1].replace(",", "_"), name)
    return plain.replace(" ", "") + "_".join(str(i) for i in index)
