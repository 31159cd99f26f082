"""Functions and classes of the package that nothing else of it uses: `python tools/uncalled.py`.

What only tests, proofs or benchmarks use is no part of the product. A name counts as used where
code other than its own reads it: in its module, in one that imports it, through its module as an
attribute, or in a text (`"module:name"`, or a statement that imports it). Examples in documentation
and handing it on (``__init__``, ``__all__``) are no use.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "src" / "evertwin"
COMMANDS = ("command", "callback")
"""Decorators that register what they stand on, so that a command line calls it."""
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


class Module:
    """One file: what it defines, imports and reads."""

    def __init__(self, name: str, tree: ast.Module) -> None:
        self.name = name
        self.defined = [node for node in tree.body if isinstance(node, Definition)]
        nodes = list(ast.walk(tree))
        self.read = defaultdict[str, set[int]](set)
        """Names to the lines where they stand."""
        for node in nodes:
            if isinstance(node, ast.Name):
                self.read[node.id].add(node.lineno)
        self.imported: list[tuple[str, str, str]] = []
        """(name here, module it is taken from, name there)."""
        self.late: set[str] = set()
        """Names of modules that are imported while the program runs."""
        self.attributes: set[tuple[str, str]] = set()
        self.texts: list[str] = []
        """module:name."""
        said = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in nodes:
            if id(node) not in said:
                self._note(node)

    def _note(self, node: ast.AST) -> None:
        if isinstance(node, ast.ImportFrom):
            items = ((item.asname or item.name, item.name) for item in node.names)
            self.imported += [(here, node.module or "", there) for here, there in items]
        elif isinstance(node, ast.Import):
            split = ((item.asname or item.name, *item.name.rpartition(".")) for item in node.names)
            self.imported += [(here, module, name) for here, module, _, name in split]
        elif isinstance(node, ast.Assign) and self._imports(node.value):
            self.late |= {ast.unparse(target) for target in node.targets}
        elif isinstance(node, ast.Attribute):
            self.attributes.add((_dotted(node.value), node.attr))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            self.texts += re.findall(r"[\w.]+:\w+", node.value)
            imports = re.findall(r"from ([\w.]+) import (\w+)", node.value)
            self.texts += [f"{module}:{name}" for module, name in imports]

    @cached_property
    def named(self) -> set[str]:
        """Whatever it could use of others, by its name there."""
        taken = {there for _, _, there in self.imported} | {name for _, name in self.attributes}
        return taken | {text.rpartition(":")[2] for text in self.texts}

    @staticmethod
    def _imports(node: ast.AST) -> bool:
        calls = (part for part in ast.walk(node) if isinstance(part, ast.Call))
        return any(_dotted(call.func).endswith("import_module") for call in calls)

    def reads(self, name: str, inside: Definition | None = None) -> bool:
        """Is a name read here, other than inside its own definition?"""
        own = range(inside.lineno, (inside.end_lineno or 0) + 1) if inside else ()
        return any(line not in own for line in self.read.get(name, ()))

    def uses(self, module: str, name: str) -> bool:
        """Does this module use what another one defines?"""
        if name not in self.named:
            return False

        def hands_on(source: str) -> bool:
            return f"{module}.".startswith(f"{source}.")

        if any((late, name) in self.attributes for late in self.late):
            return True
        return any(
            (there == name and hands_on(source) and self.reads(here))
            or (hands_on(f"{source}.{there}") and (here, name) in self.attributes)
            for here, source, there in self.imported
        ) or any(hands_on(text.split(":")[0]) and text.endswith(f":{name}") for text in self.texts)


def _dotted(node: ast.AST) -> str:
    """``a.b`` as it is written; empty for what is no name."""
    if isinstance(node, ast.Attribute):
        before = _dotted(node.value)
        return before and f"{before}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def modules(package: Path) -> Iterator[Module]:
    """All files of a package."""
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        yield Module(".".join(parts), ast.parse(path.read_text(encoding="utf-8")))


def uncalled(package: Path = PACKAGE) -> list[str]:
    """``module.name`` of what is defined and used nowhere else in the package."""
    every = list(modules(package))
    return [
        f"{one.name}.{node.name}"
        for one in every
        for node in one.defined
        if not node.name.startswith("__")
        and not any(word in ast.unparse(d) for d in node.decorator_list for word in COMMANDS)
        and not one.reads(node.name, node)
        and not any(other.uses(one.name, node.name) for other in every)
    ]


if __name__ == "__main__":
    sys.stdout.writelines(f"{name}\n" for name in uncalled())
