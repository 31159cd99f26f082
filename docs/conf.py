"""Sphinx configuration: MyST pages, reference pages written from the source's docstrings."""

from __future__ import annotations

import gc
import importlib.metadata
import re
import shutil
from functools import cached_property
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.domains.python import PythonDomain

import evertwin

project = "evertwin"
author = "the evertwin authors"
copyright = author
release = importlib.metadata.version("evertwin")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
nitpicky = False
# Two rooms may use one word (Rows, Problem); a reference by the short name then has two targets.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"evertwin {release}"
html_static_path: list[str] = []

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": False}
autodoc_preserve_defaults = True
autodoc_use_type_comments = False

# Every page is kept as a tree: looking through all of them for what is free takes long, and finds
# little.
gc.set_threshold(100_000, 50, 100)

SECTION = re.compile(r"^[A-Z][a-z]+:$")
BULLET = re.compile(r"^([*-] |\d+\. )(.*)$")
PACKAGE = Path(evertwin.__path__[0])
HIDE = "   :no-members:\n"
"""A package only re-exports: each name is documented where it is defined."""
API = Path(__file__).parent / "reference" / "api"


class Names(PythonDomain):
    """Looks for a short name among those that end in it: Sphinx goes through all for each hint."""

    near: dict[str, Any] | None = None

    @cached_property
    def ends(self) -> dict[str, dict[str, Any]]:
        """All names by their last part; first asked when all are known."""
        found: dict[str, dict[str, Any]] = {}
        for name, entry in super().objects.items():
            found.setdefault(name.rpartition(".")[2], {})[name] = entry
        return found

    @property
    def objects(self) -> dict[str, Any]:  # type: ignore[override]
        return super().objects if self.near is None else self.near

    def find_obj(self, env: Any, modname: str, classname: str, name: str, *more: Any) -> Any:
        self.near = self.ends.get(name.removesuffix("()").rpartition(".")[2], {})
        try:
            return super().find_obj(env, modname, classname, name, *more)
        finally:
            self.near = None


class Titles:
    """Contents of the pages, of titles alone, for the navigation.

    Sphinx copies all that a page names, for each page, and throws all but its title away then.
    """

    def __init__(self) -> None:
        self.short: dict[str, nodes.bullet_list] = {}

    def navigation(
        self, app: Any, page: str, template: str, context: dict[str, Any], doctree: object
    ) -> None:
        """Before the theme asks for it."""
        made, env = context["toctree"], app.env

        def toctree(**options: Any) -> str:
            full = env.tocs
            for name in full.keys() - self.short.keys():
                self.short[name] = self.title(full[name])
            env.tocs = self.short
            try:
                return str(made(**options))
            finally:
                env.tocs = full

        context["toctree"] = toctree

    @staticmethod
    def title(toc: nodes.bullet_list) -> nodes.bullet_list:
        """The title of a page; all of its contents where it names further pages."""
        items = toc.children
        plain = all(isinstance(item, nodes.list_item) for item in items)
        if not plain or next(toc.findall(addnodes.toctree), None) is not None:
            return toc
        short = toc.copy()
        for item in items:
            short += item.copy()
            short[-1].extend(child.deepcopy() for child in item.children[:1])
        return short


def escape(line: str) -> str:
    """Docstrings are plain text: ``|v|`` and ``f*`` are formulas, not markup."""
    parts = re.split(r"(`+[^`]*`+)", line)
    return "".join(
        part if part.startswith("`") else re.sub(r"([*|\\]|_(?=\W|$))", r"\\\1", part)
        for part in parts
    )


def as_rst(
    app: object, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Paragraphs flow; what is indented (tables, trees, formulas) is shown as written."""
    out: list[str] = []
    mode = "text"
    for line in lines:
        bullet = BULLET.match(line)
        if line.startswith(">>>") or (mode == "example" and line.strip()):
            out += ["", line] if mode != "example" else [line]
            mode = "example"
        elif not line.strip():
            out.append("")
            mode = "text" if mode in ("example", "bullet") else mode
        elif bullet:
            out += ["", bullet[1] + escape(bullet[2])]
            mode = "bullet"
        elif line.startswith(" ") and mode == "bullet":
            out.append(line[: len(line) - len(line.lstrip())] + escape(line.lstrip()))
        elif line.startswith(" "):
            out += [f"    {line}"] if mode == "literal" else ["", "::", "", f"    {line}"]
            mode = "literal"
        else:
            out += [""] if mode == "literal" else []
            out += ["", f"**{line[:-1]}**", ""] if SECTION.match(line) else [escape(line)]
            mode = "text"
    lines[:] = [*out, ""]


def write_api(app: object) -> None:
    """One page for each room, with its public modules in order."""
    shutil.rmtree(API, ignore_errors=True)
    API.mkdir(parents=True)
    rooms: dict[str, list[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        module = ".".join(("evertwin", *parts)).removesuffix(".__init__")
        if not any(part.startswith("_") for part in module.split(".")):
            rooms.setdefault(module.split(".")[1] if "." in module else "evertwin", []).append(
                module
            )
    for room, modules in rooms.items():
        text = [f"# {modules[0]}\n"]
        for module in modules:
            title = f"## {module}\n\n" if module != modules[0] else ""
            own = "" if (PACKAGE.parent / (module.replace(".", "/") + ".py")).is_file() else HIDE
            text.append(f"{title}```{{eval-rst}}\n.. automodule:: {module}\n{own}```\n")
        (API / f"{room}.md").write_text("\n".join(text), encoding="utf-8")


def setup(app: object) -> None:
    """Register the steps."""
    app.add_domain(Names, override=True)  # type: ignore[attr-defined]
    app.connect("autodoc-process-docstring", as_rst)  # type: ignore[attr-defined]
    app.connect("builder-inited", write_api)  # type: ignore[attr-defined]
    app.connect("html-page-context", Titles().navigation, 400)  # type: ignore[attr-defined]
