"""The budgets of the source, measured on its syntax trees.

Every test lists all offenders at once. An exception to a rule is named here, with its reason.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "evertwin"

WORDS = 15_000
"""Of the documentation outside the reference, code blocks aside."""
FILE_LINES = 400
BODY_LINES = 60
PARAMETERS = 6
LONGER = "# longer than the budget:"
"""A numerical step may exceed BODY_LINES where such a comment in it argues why."""

COMPILED = {"cfunc", "intrinsic", "jit", "njit", "overload", "vectorize"}
"""Numba's decorators: the signature of such a function is Numba's."""

BROAD_EXCEPT = {
    (
        "service/twin/runner.py",
        "_guarded",
    ): "a model or plug-in of the user raises what it likes: its twin alone ends",
    (
        "service/site/loading.py",
        "why_not",
    ): "a model or plug-in of the user raises what it likes: its node says so",
    ("app/cli.py", "main"): "the last edge: an unforeseen error becomes exit code 101",
    ("sources/foreign.py", "foreign"): "readers of others: no reader says all that it may raise",
    ("engine/pool.py", "serve"): "what a job raises is raised where its result is taken",
    (
        "service/twin/twin_thread.py",
        "_run",
    ): "what a job raises is raised where its result is taken",
    ("engine/worker.py", "_outcome"): "what a job raises travels to the parent, which raises it",
    (
        "models/functions/function.py",
        "step",
    ): "the step is the user's code: its error is a lost row",
    (
        "models/functions/function.py",
        "row",
    ): "the step is the user's code: what it raises is told as the model's",
    (
        "models/functions/translated.py",
        "translated",
    ): "a compiler does not say all that it may raise: the step runs as plain Python",
    (
        "machines/python_file.py",
        "model_from_file",
    ): "the file is the user's code: what it raises is told with its line",
    (
        "machines/python_file.py",
        "_tried",
    ): "the file is the user's code: what it raises is told with its line",
    (
        "machines/catalog.py",
        "machine",
    ): "the factory of another package raises what it likes: it is told as the model's",
}
"""The edges where any exception is caught, by (file, function)."""

AnyFunction = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Source:
    """One file and its tree."""

    name: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @property
    def public(self) -> bool:
        return not any(part.startswith("_") for part in Path(self.name).parts)


@cache
def sources() -> tuple[Source, ...]:
    return tuple(read(path) for path in sorted(PACKAGE.rglob("*.py")))


def read(path: Path) -> Source:
    return Source(path.relative_to(PACKAGE).as_posix(), path.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Function:
    """A function with the names around it."""

    source: Source
    node: AnyFunction
    around: tuple[ast.AST, ...]

    @property
    def where(self) -> str:
        return f"{self.source.name}:{self.node.lineno} {self.node.name}"

    @property
    def method_of(self) -> ast.ClassDef | None:
        owner = self.around[-1] if self.around else None
        return owner if isinstance(owner, ast.ClassDef) else None

    @property
    def arguments(self) -> list[ast.arg]:
        a = self.node.args
        named = [*a.posonlyargs, *a.args]
        if self.method_of is not None and "staticmethod" not in decorators(self.node):
            named = named[1:]
        return named + [x for x in (a.vararg, *a.kwonlyargs, a.kwarg) if x is not None]


def decorators(node: AnyFunction | ast.ClassDef) -> set[str]:
    """The last word of each decorator: ``nb.njit(cache=True)`` is ``njit``."""
    called = (d.func if isinstance(d, ast.Call) else d for d in node.decorator_list)
    return {d.attr if isinstance(d, ast.Attribute) else getattr(d, "id", "") for d in called}


def functions(source: Source) -> Iterator[Function]:
    def walk(node: ast.AST, around: tuple[ast.AST, ...]) -> Iterator[Function]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, AnyFunction):
                yield Function(source, child, around)
            scope = isinstance(child, (*AnyFunction.__args__, ast.ClassDef))
            yield from walk(child, (*around, child) if scope else around)

    return walk(source.tree, ())


@cache
def all_functions() -> list[Function]:
    return [function for source in sources() for function in functions(source)]


def body_lines(node: AnyFunction) -> int:
    """Lines after the docstring."""
    body = node.body[1:] if ast.get_docstring(node) is not None else node.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0


def offenders(bad: Callable[[Function], object]) -> list[str]:
    return [f"{f.where}: {found}" for f in all_functions() if (found := bad(f))]


def test_files_are_short() -> None:
    long = {s.name: n for s in sources() if (n := len(s.text.splitlines())) > FILE_LINES}
    assert not long, f"over {FILE_LINES} lines: {long}"


def test_functions_are_short() -> None:
    def too_long(f: Function) -> int:
        if (lines := body_lines(f.node)) <= BODY_LINES:
            return 0
        return 0 if LONGER in (ast.get_source_segment(f.source.text, f.node) or "") else lines

    assert not (found := offenders(too_long)), f"over {BODY_LINES} lines: {found}"


def test_functions_take_few_parameters() -> None:
    def too_many(f: Function) -> int:
        # A compiled function takes its arrays one by one, and step(context, x, u, dt, p, x_next, y)
        # is the C interface of the contract, not the author's choice.
        names = [a.arg for a in f.arguments]
        # A command's parameters are its options.
        command = f.source.name.startswith("app/") and "command" in decorators(f.node)
        fixed = (
            command
            or bool(COMPILED & decorators(f.node))
            or names[:1]
            in (
                ["context"],
                ["_context"],
                ["_"],
            )
        )
        return 0 if fixed or len(names) <= PARAMETERS else len(names)

    assert not (found := offenders(too_many)), f"over {PARAMETERS} parameters: {found}"


def test_everything_is_annotated() -> None:
    def bare(f: Function) -> list[str]:
        if COMPILED & decorators(f.node):
            return []  # its signature is Numba's
        missing = [a.arg for a in f.arguments if a.annotation is None]
        return missing + (["return"] if f.node.returns is None else [])

    assert not (found := offenders(bare)), f"not annotated: {found}"


def test_nothing_is_printed() -> None:
    found = [
        f"{s.name}:{node.lineno}"
        for s in sources()
        for node in ast.walk(s.tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "print"
    ]
    assert not found, f"print: {found}"


def caught(handler: ast.ExceptHandler) -> set[str]:
    if handler.type is None:
        return {"bare"}
    return {node.id for node in ast.walk(handler.type) if isinstance(node, ast.Name)}


def handlers(node: ast.AST, function: str = "") -> Iterator[tuple[str, ast.ExceptHandler]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ExceptHandler):
            yield function, child
        yield from handlers(child, child.name if isinstance(child, AnyFunction) else function)


def test_exceptions_are_caught_by_name() -> None:
    found = [
        f"{s.name}:{handler.lineno} in {function}"
        for s in sources()
        for function, handler in handlers(s.tree)
        if caught(handler) & {"bare", "Exception", "BaseException"}
        and (s.name, function) not in BROAD_EXCEPT
    ]
    assert not found, f"bare or broad except: {found}"


def test_exceptions_are_raised_by_name() -> None:
    found = [
        f"{s.name}:{node.lineno}"
        for s in sources()
        for node in ast.walk(s.tree)
        if isinstance(node, ast.Raise)
        and isinstance(node.exc, ast.Call)
        and getattr(node.exc.func, "id", "") in ("Exception", "BaseException")
    ]
    assert not found, f"raise Exception: {found}"


def imports_package(node: ast.AST) -> bool:
    if isinstance(node, ast.ImportFrom):
        return node.level > 0 or (node.module or "").split(".")[0] == "evertwin"
    if isinstance(node, ast.Import):
        return any(alias.name.split(".")[0] == "evertwin" for alias in node.names)
    return False


def test_no_local_imports_of_the_package() -> None:
    def local(f: Function) -> list[int]:
        if f.source.name.startswith("app/") or f.source.name == "__init__.py":
            return []  # the command line and the lazy surface import what a command needs
        return sorted({n.lineno for n in ast.walk(f.node) if imports_package(n)})

    assert not (found := offenders(local)), f"imports inside functions: {found}"


NUMBA = {f"compiled/{name}.py" for name in ("functions", "intrinsics", "kept")} | {
    "models/fmu/calls.py"
}
"""What knows Numba: all others decorate with `evertwin.compiled.functions`."""


def test_numba_is_loaded_where_something_is_compiled() -> None:
    found = [
        f"{s.name}:{node.lineno}"
        for s in sources()
        if s.name not in NUMBA
        for node in ast.walk(s.tree)
        if (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "numba")
        or (
            isinstance(node, ast.Import)
            and any(a.name.split(".")[0] == "numba" for a in node.names)
        )
    ]
    assert not found, f"imports of Numba: {found}"


SAME_BITS = {
    "np": {
        "abs", "all", "any", "arange", "bool_", "ceil", "empty", "empty_like", "float64", "floor",
        "full", "iinfo", "inf", "int32", "int64", "isfinite", "isinf", "isnan", "median", "nan",
        "ndarray", "ones", "pi", "rint", "sort", "sqrt", "uint8", "uint64", "zeros", "zeros_like",
    },
    "math": {
        "acos", "asin", "atan", "atan2", "ceil", "cos", "cosh", "e", "erfc", "exp", "floor", "inf",
        "isfinite", "isnan", "log", "log10", "log1p", "nan", "pi", "pow", "sin", "sinh", "sqrt",
        "tan", "tanh",
    },
}  # fmt: skip
"""What compiled functions may take of NumPy and of `math`: the same bits in plain Python. Sums and
products are loops, whose order is written down; powers are products, or `math.pow`."""
METHODS = {"any", "copy", "max", "min", "view"}
"""What they may ask an array for; they name what they call otherwise."""
WHOLE = {"sources[:, TIMELY].sum", "samples.sum", "vary.sum"}
"""Sums of whole numbers."""


def runs_in_both_forms(source: Source, node: ast.AST) -> bool:
    """Is it a function that may be compiled and may run plain?"""
    if "friction/terms/" in source.name:
        return isinstance(node, ast.FunctionDef)
    made = [ast.unparse(d) for d in getattr(node, "decorator_list", ())]
    return any(d.startswith(("njit(", "cfunc(")) and "exact=False" not in d for d in made)


def strange(part: ast.AST) -> bool:
    """May the two forms of this differ by a bit?"""
    if isinstance(part, ast.BinOp):
        exact = isinstance(part.left, ast.Constant) and part.left.value == 2.0
        power = isinstance(part.op, ast.Pow) and not exact
        return power or isinstance(part.op, ast.MatMult)
    if isinstance(part, ast.Call) and isinstance(part.func, ast.Attribute):
        asked = ast.unparse(part.func.value) not in SAME_BITS and part.func.attr not in METHODS
        return asked and ast.unparse(part.func) not in WHOLE
    if isinstance(part, ast.Attribute):
        known = SAME_BITS.get(ast.unparse(part.value))
        return known is not None and part.attr not in known
    return False


def test_compiled_functions_give_the_same_bits_in_plain_python() -> None:
    found = [
        f"{source.name}:{part.lineno} {ast.unparse(part)}"
        for source in sources()
        for node in ast.walk(source.tree)
        if runs_in_both_forms(source, node)
        for part in ast.walk(node)
        if isinstance(part, ast.expr) and strange(part)
    ]
    assert not found, f"not the same bits in both forms: {found}"


def test_no_room_imports_the_root() -> None:
    found = [
        f"{s.name}:{node.lineno}"
        for s in sources()
        if s.name not in ("__init__.py", "__main__.py") and not s.name.startswith("app/")
        for node in ast.walk(s.tree)
        if (isinstance(node, ast.ImportFrom) and node.module == "evertwin" and node.level == 0)
        or (isinstance(node, ast.Import) and any(a.name == "evertwin" for a in node.names))
    ]
    assert not found, f"imports of the package's root: {found}"


def public(name: str) -> bool:
    return not name.startswith("_")


def test_public_functions_have_docstrings() -> None:
    def silent(f: Function) -> str:
        owner = f.method_of
        nested = any(isinstance(a, AnyFunction) for a in f.around)
        hidden = nested or not f.source.public or not public(f.node.name)
        if hidden or (owner is not None and not public(owner.name)):
            return ""
        # A contract's verb is documented once, by the contract; here only what differs.
        verb = owner is not None and f.node.name in contract_verbs()
        overload = "overload" in decorators(f.node)
        return "" if verb or overload or ast.get_docstring(f.node) else "no docstring"

    assert not (found := offenders(silent)), found


@cache
def contract_verbs() -> frozenset[str]:
    """Members of every Protocol and every abstract base of the package."""
    return frozenset(
        member.name
        for source in sources()
        for node in ast.walk(source.tree)
        if isinstance(node, ast.ClassDef)
        and {"ABC", "Protocol"} & {ast.unparse(base).partition("[")[0] for base in node.bases}
        for member in node.body
        if isinstance(member, AnyFunction)
    )


def test_modules_open_with_their_idea() -> None:
    found = [s.name for s in sources() if s.text.strip() and not ast.get_docstring(s.tree)]
    assert not found, f"no module docstring: {found}"


def test_public_classes_have_an_example() -> None:
    found = []
    for source in sources():
        if not source.public:
            continue
        opening = ast.get_docstring(source.tree) or ""
        for node in source.tree.body:
            if not isinstance(node, ast.ClassDef) or not public(node.name):
                continue
            own = ast.get_docstring(node) or ""
            shown = ">>>" in own or (">>>" in opening and node.name in opening)
            if not own or not shown:
                found.append(f"{source.name}:{node.lineno} {node.name}")
    assert not found, f"public classes without a docstring with an example: {found}"


def test_constraints_are_names_and_versions_only() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    found = [line for line in lines if line.count("==") != 1 or "/" in line or " " in line]
    assert not found, found


def test_the_budgets_are_able_to_fail() -> None:
    text = "def f(a, b: int):\n    try:\n        print(a)\n    except Exception:\n        pass\n"
    tree = ast.parse(text)
    (function,) = functions(Source("x.py", text))
    assert body_lines(function.node) == 4
    assert [a.arg for a in function.arguments if a.annotation is None] == ["a"]
    assert [caught(h) for _, h in handlers(tree)] == [{"Exception"}]


def test_what_is_written_by_hand_is_short() -> None:
    words = 0
    for page in (ROOT / "docs").rglob("*.md"):
        if "reference" not in page.parts:
            words += len(re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL).split())
    assert words <= WORDS
