"""A plain Python step as machine code, where it is arithmetic on numbers.

A function that only computes (with `math`, NumPy, and functions of its own kind) runs a hundred
times faster so. What it reads must not change: numbers, arrays and other functions are taken as
they are now. Whether it is translated follows from the source alone, so every process runs the
same code; one that cannot be, or that differs from the interpreter on trial rows, runs as it is,
and its notes say why.

>>> from evertwin.models.parameters import Parameters
>>> from evertwin.signals.channels import Layout
>>> def tank(x, u, dt, p):
...     (level,), (leak,) = x, p
...     level += dt * (u[0] - leak * level)
...     return [level], [level]
>>> level = Layout.of(level="m")
>>> slow = FunctionModel(tank, Layout.of(inflow="m/s"), level, level,
...     Parameters.of(leak=(0.1, "1/s")))
>>> fast = translated(slow)
>>> fast.notes
('its step runs as machine code',)
>>> fast.simulate(np.zeros(1), np.ones((2, 1)), np.ones(2), fast.parameters.values)[1].ravel()
array([1. , 1.9])
"""

from __future__ import annotations

import ast
import inspect
import linecache
import logging
import math
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numpy as np

from evertwin.compiled.functions import OBSERVE, STEP, CFunction, Function
from evertwin.compiled.stamp import names_of
from evertwin.errors import ModelError, UsageError, naming
from evertwin.models.functions.failures import HUGE, Failures, at_inputs
from evertwin.models.functions.function import FunctionModel
from evertwin.models.kernels.kernel import RAISED, Kernel, Restart
from evertwin.models.kernels.rollout import roll
from evertwin.signals.channels import Layout
from evertwin.signals.units import conversion
from evertwin.types import Inputs, Int64, Intervals, ParameterVector, Rollout, StateVector

log = logging.getLogger("evertwin")

OPTIONS = {"error_model": "numpy", "boundscheck": True}
"""A division by zero is no number, as a row that fails is; a wrong index fails."""
BUILT_IN = {"abs", "bool", "enumerate", "float", "int", "len", "max", "min", "range", "round",
            "sum", "zip"}  # fmt: skip
TRIALS = 24
"""Rows on which both forms have to agree."""
CLOSE = 1e-9
"""Relative difference that the order of operations may make."""


@dataclass(frozen=True, repr=False)
class Translated(FunctionModel):
    """A `FunctionModel` whose step is machine code. See `translated`.

    >>> issubclass(Translated, FunctionModel)
    True
    """

    @cached_property
    def _kernel(self) -> Kernel:
        assert isinstance(self.step, FunctionType)
        finish = _written(self.step, _finish_source(self), "compiled_finish", {})
        space = {
            "model": _prepared(self.step), "finish": Function(finish, {"cache": True, **OPTIONS})
        }  # fmt: skip
        step = _written(self.step, _step_source(self), "compiled_step", space)
        adopt = _written(self.step, _observe_source(self._adopts), "compiled_observe", {})
        calls = CFunction(step, STEP, OPTIONS), CFunction(adopt, OBSERVE, {})
        kept = np.zeros(1 + sum(_sizes(self)), dtype=np.int64)

        def forget() -> None:
            kept[0] = 0

        failures = Failures(lambda: _why(self, kept), forget)
        return Kernel(*calls, kept, (*calls, self.step, failures))

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """State after the last row and the outputs of every row; a row that failed is NaN."""
        return roll(self.kernel(), x, u, dt, p, Restart.never(len(u), len(self.outputs)))

    @property
    def notes(self) -> tuple[str, ...]:
        """How it runs."""
        return ("its step runs as machine code",)


def translated(model: FunctionModel) -> FunctionModel:
    """The model with its step as machine code; itself where that cannot be, which is logged."""
    made = Translated(**{one.name: getattr(model, one.name) for one in fields(model)})
    try:
        _refused(model.step)
        kernel = made.kernel()
        _ = int(kernel.step), int(kernel.observe)
    except Exception as error:  # noqa: BLE001  a compiler does not say all that it may raise
        log.info("the model's step runs as plain Python: %s", error)
        return model
    if not _agree(model, made):
        log.info("the model's step runs as plain Python: machine code of it gives other values")
        return model
    return made


def _refused(function: Callable[..., Any], seen: frozenset[Any] = frozenset()) -> None:
    """Reads the function anything that may change, or keeps something?

    Raises:
        UsageError: it does, or its source is not to be had.
    """
    if not isinstance(function, FunctionType) or function.__defaults__:
        raise UsageError(f"{function!r} is no plain function without defaults")
    code, space = function.__code__, _space(function)
    for name in (*names_of(code), *code.co_freevars):
        if name not in space:
            continue  # built in, or an attribute
        it = space[name]
        if isinstance(it, FunctionType) and it is not function and it not in seen:
            _refused(it, seen | {function})
        elif it is function or it in seen if isinstance(it, FunctionType) else False:
            raise UsageError(f"{name} calls itself")
        elif isinstance(it, ModuleType):
            if it.__name__ not in ("math", "numpy"):
                raise UsageError(f"it reads the module {name}")
        elif not isinstance(it, int | float | np.ndarray | BuiltinFunctionType | np.ufunc):
            raise UsageError(f"it reads {name}, a {type(it).__name__}")
    tree = ast.walk(_tree(function))
    if any(isinstance(node, ast.Global | ast.Nonlocal | ast.Yield | ast.Await) for node in tree):
        raise UsageError("it keeps something between two calls")
    if "random" in code.co_names:
        raise UsageError("it draws numbers")


def _space(function: FunctionType) -> Mapping[str, Any]:
    """What a function reads by name, what it closes over included.

    Raises:
        UsageError: some of that has no value yet.
    """
    with naming(f"{function.__name__} reads what has no value", ValueError):
        return {**function.__globals__, **inspect.getclosurevars(function).nonlocals}


def _tree(function: FunctionType) -> ast.FunctionDef:
    """The source of a function that is defined by ``def``.

    Raises:
        UsageError: it is not, or there is no source.
    """
    linecache.checkcache(function.__code__.co_filename)
    with naming(f"{function.__name__}: no source", (OSError, SyntaxError, TypeError)):
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    made = tree.body[0]
    if not isinstance(made, ast.FunctionDef) or made.decorator_list:
        raise UsageError(f"{function.__name__} is not defined by def alone")
    return ast.increment_lineno(made, first - 1)


class _Tuples(ast.NodeTransformer):
    """What machine code has no arrays for: ``a, b = x`` by index, and returned lists as tuples;
    without what is said of types, which names more than the function reads."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """``def step(x: Vector) -> Pair``."""
        node.returns = None
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        """``x: Vector``."""
        node.annotation = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST | None:
        """``a: float = x[0]``."""
        if node.value is None:
            return None
        return self.visit_Assign(ast.copy_location(ast.Assign([node.target], node.value), node))

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        """``a, b = x`` and ``(a, b), c = x, y``."""
        if len(node.targets) == 1:
            node.value = _taken(node.targets[0], node.value)
        return self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> ast.AST:
        """``return [a], [b]``."""
        if isinstance(node.value, ast.Tuple):
            node.value.elts = [
                ast.Tuple(one.elts, ast.Load()) if isinstance(one, ast.List) else one
                for one in node.value.elts
            ]
        return self.generic_visit(node)


def _taken(target: ast.expr, value: ast.expr) -> ast.expr:
    """The value, by index where a name is taken apart."""
    if not isinstance(target, ast.Tuple | ast.List):
        return value
    if isinstance(value, ast.Name):
        parts: list[ast.expr] = [
            ast.Subscript(ast.Name(value.id, ast.Load()), ast.Constant(k), ast.Load())
            for k in range(len(target.elts))
        ]
        return ast.Tuple(parts, ast.Load())
    if isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
        value.elts = [_taken(t, v) for t, v in zip(target.elts, value.elts, strict=True)]
    return value


def _prepared(function: FunctionType) -> Function:
    """The function, and those that it calls, as machine code can be made of them."""
    tree = ast.fix_missing_locations(_Tuples().visit(_tree(function)))
    space = {
        name: _prepared(it) if isinstance(it, FunctionType) and it is not function else it
        for name, it in _space(function).items()
        if name in {*names_of(function.__code__), *function.__code__.co_freevars}
    }  # fmt: skip
    made = _compiled(ast.Module([tree], []), function, space, function.__name__)
    return Function(made, {"cache": True, **OPTIONS})


def _written(
    function: FunctionType, source: str, name: str, space: Mapping[str, Any]
) -> FunctionType:
    """A function of written source, that counts as one of the file that the step is in."""
    return _compiled(ast.parse(source), function, {**space, "np": np, "math": math}, name)


def _compiled(tree: ast.Module, of: FunctionType, space: dict[str, Any], name: str) -> FunctionType:
    exec(compile(tree, of.__code__.co_filename, "exec"), space)
    made = space[name]
    assert isinstance(made, FunctionType)
    # kept machine code looks for its module, and the user's is none that can be imported
    made.__module__, made.__qualname__ = __name__, f"{of.__module__}.{name}"
    return made


def _finish_source(model: FunctionModel) -> str:
    """What ``model`` gives, in SI, and a return code; apart from the step, in whose `try` each
    operation would be a branch, and compiling takes its time by their square."""
    nx, ny = len(model.states), len(model.outputs)
    values = [f"ahead[{i}]" for i in range(nx)] + [f"y[{i}]" for i in range(ny)]
    given = [f"new[{i}]" for i in range(nx)] + [f"out[{i}]" for i in range(ny)]
    si = [_unless_si(model.states, i, "{0} * {1} + {2}", one) for i, one in enumerate(given[:nx])]
    si += [_unless_si(model.outputs, i, "{0} * {1} + {2}", one) for i, one in enumerate(given[nx:])]
    finite = " & ".join(f"math.isfinite({value})" for value in given) or "True"
    lost = " | ".join(f"({value} != {value})" for value in given) or "False"
    sound = " & ".join(f"(abs({one}) < {HUGE})" for one in _row_of(model)) or "True"
    return "\n".join([
        "def compiled_finish(new, out, x, u, p, ahead, y):",
        f"    if len(new) != {nx} or len(out) != {ny}:",
        f"        return {RAISED}",
        f"    if {finite}:",
        *[f"        {value} = {one}" for value, one in zip(values, si, strict=True)],
        "        return 0",
        f"    if ({lost}) and ({sound}):",
        f"        return {RAISED}",
        "    return 1",
    ])  # fmt: skip


def _row_of(model: FunctionModel) -> list[str]:
    """All that a row depends on, but for its interval."""
    return [f"{name}[{i}]" for name, size in zip("xup", _sizes(model)[1:]) for i in range(size)]


def _step_source(model: FunctionModel) -> str:
    """The compiled signature around ``model``, which computes in the units that it states."""
    stated = "({0} - {2}) / {1}"
    taken = {
        "x": [_unless_si(model.states, i, stated, f"x[{i}]") for i in range(len(model.states))],
        "u": [_unless_si(model.inputs, i, stated, f"u[{i}]") for i in range(len(model.inputs))],
        "p": [f"p[{i}]" for i in range(len(model.parameters))],
    }
    return "\n".join([
        "def compiled_step(context, x, u, dt, p, ahead, y):",
        *[f"    {name}_ = np.array([{', '.join(of)}], dtype=np.float64)" if of
          else f"    {name}_ = np.empty(0)" for name, of in taken.items()],
        "    try:",
        "        new, out = model(x_, u_, dt, p_)",
        "        failed = finish(new, out, x, u, p, ahead, y)",
        "    except Exception:",
        f"        failed = {RAISED}",
        f"    if failed == {RAISED} and context[0] == 0:",
        "        context[0] = 1",
        f"        row = np.array([{', '.join(['dt', *_row_of(model)])}], dtype=np.float64)",
        "        bits = row.view(np.int64)",
        "        for k in range(len(bits)):",
        "            context[1 + k] = int(bits[k])",
        "    return failed",
    ])  # fmt: skip


def _sizes(model: FunctionModel) -> tuple[int, int, int, int]:
    """Of the interval, the states, the inputs and the parameters, as a failed row is kept."""
    return 1, len(model.states), len(model.inputs), len(model.parameters)


def _why(model: FunctionModel, kept: Int64[np.ndarray, " k"]) -> str:
    """What the step raises at the row that failed first, by the interpreter."""
    if kept[0] == 0:
        return ""
    (dt,), x, u, p = np.split(kept[1:].view(np.float64), np.cumsum(_sizes(model))[:-1])
    try:
        model.row(x, u, float(dt), p)
    except ModelError as error:
        return at_inputs(error, model.inputs, u)
    return ""


def _unless_si(layout: Layout, k: int, form: str, value: str) -> str:
    """The formula between SI and the unit that is stated; the value alone where that is SI."""
    stated = layout.channels[k].stated
    return form.format(value, *conversion(stated)) if stated else value


def _observe_source(adopts: tuple[tuple[int, int], ...]) -> str:
    lines = [f"    if y[{o}] == y[{o}]:\n        x[{i}] = y[{o}]" for o, i in adopts]
    return "\n".join(["def compiled_observe(context, x, y):", *lines, "    return 0"])


def _agree(slow: FunctionModel, fast: Translated) -> bool:
    """Do both forms give the same on trial rows, near the start and far from it?"""
    p, rng = slow.parameters.values, np.random.default_rng(0)
    start = slow.states.to_stated(slow.initial(p))
    for k in range(TRIALS):
        size = 10.0 ** rng.integers(-2, 3) * (k > 0)
        x = slow.states.from_stated(start + size * rng.normal(size=len(start)))
        u = slow.inputs.from_stated(size * rng.normal(size=(1, len(slow.inputs))))
        dt, q = np.array([10.0 ** rng.integers(-2, 1)]), p * (1.0 + 0.1 * rng.normal(size=len(p)))
        a, b = (_row(model, x, u, dt, q) for model in (slow, fast))
        if not np.allclose(a, b, rtol=CLOSE, atol=CLOSE * size, equal_nan=True):
            return False
    return True


def _row(
    model: FunctionModel, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector
) -> np.ndarray:
    """Outputs and state of one row; NaN where it fails."""
    nothing = np.full(len(x) + len(model.outputs), np.nan)
    try:
        with np.errstate(all="ignore"):  # these are no rows of the machine's
            ahead, out = model.simulate(x, u, dt, p)
        found = np.concatenate([np.asarray(ahead, dtype=np.float64), out[0]])
    except ModelError:
        return nothing
    return found if np.isfinite(out).all() and np.isfinite(ahead).all() else nothing
