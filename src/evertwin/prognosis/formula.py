"""A function of several values, written as text: ``"Fc1 + 0.5 * Fv1"``.

Numbers, names, + − * / **, parentheses, ``sqrt`` and ``abs``: nothing else is run. A name stands
for a number or for a whole column: both are worked out alike.

>>> friction = Formula.parse("Fc1 + 0.5 * Fv1")
>>> friction.names, float(friction({"Fc1": 12.0, "Fv1": 10.0}))
(('Fc1', 'Fv1'), 17.0)
>>> friction({"Fc1": np.array([12.0, 14.0]), "Fv1": 10.0}).tolist()
[17.0, 19.0]
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evertwin.errors import UsageError

_BINARY: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
    ast.Pow: np.power,
}  # fmt: skip
_CALLS: Mapping[str, Callable[[Any], Any]] = {"sqrt": np.sqrt, "abs": np.abs}
LONGEST = 500


@dataclass(frozen=True)
class Formula:
    """See the module for an example."""

    text: str
    tree: ast.expr
    names: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> Formula:
        """A formula from its text.

        Raises:
            UsageError: it is no such formula.
        """
        try:
            tree = ast.parse(text if len(text) <= LONGEST else "", mode="eval").body
        except SyntaxError as error:
            raise UsageError(f"formula: {text!r} is not understood: {error.msg}") from error
        names: list[str] = []
        _check(text, tree, names)
        return cls(text, tree, tuple(dict.fromkeys(names)))

    def __call__(self, values: Mapping[str, float | np.ndarray]) -> np.ndarray:
        """The value, of the shape that numbers and columns have together.

        NaN where it is not defined: a division by zero, a root of less, a number too large.
        """
        with np.errstate(all="ignore"):
            found = np.asarray(_value(self.tree, values), dtype=np.float64)
        return np.where(np.isfinite(found), found, np.nan)


def _check(text: str, node: Any, names: list[str]) -> None:
    if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        _check(text, node.left, names)
        _check(text, node.right, names)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        _check(text, node.operand, names)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id not in _CALLS or len(node.args) != 1 or node.keywords:
            raise UsageError(f"formula: {text!r}: expected sqrt(…) or abs(…)")
        _check(text, node.args[0], names)
    elif isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
        names.append(ast.unparse(node))
    elif not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
        raise UsageError(f"formula: {text!r}: expected numbers, names, + - * / **, sqrt and abs")


def _value(node: Any, values: Mapping[str, float | np.ndarray]) -> Any:
    if isinstance(node, ast.BinOp):
        return _BINARY[type(node.op)](_value(node.left, values), _value(node.right, values))
    if isinstance(node, ast.UnaryOp):
        return -_value(node.operand, values)
    if isinstance(node, ast.Call):
        return _CALLS[ast.unparse(node.func)](_value(node.args[0], values))
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]
    return values[ast.unparse(node)]
