"""The JSON schema and the reference page agree with what is read."""

from __future__ import annotations

import inspect
import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from evertwin.ahead.spec import SCENARIO
from evertwin.config import TWIN, read, spec
from evertwin.engineering.breakdown import BREAKDOWN
from evertwin.settings.form import Form
from evertwin.settings.schema import schema
from evertwin.settings.section import Section, settings
from tools.settings_page import page

ROOT = Path(__file__).parent.parent.parent
TWINS = sorted((ROOT / "twins").glob("*.toml"))


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    content = schema(TWIN)
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


def test_the_schema_accepts_what_is_read(
    validator: jsonschema.Draft202012Validator, full_text: str
) -> None:
    validator.validate(tomllib.loads(full_text))


@pytest.mark.parametrize(
    "text",
    [
        "[clock]\nrat = 5",
        "beat = 0",
        "beat = 1.5",
        "[clock]\nrate = 'fast'",
        "[tuning]\nmethod = 'recursiv'",
        "[arbiter.groups.pose]\nvot = 3",
        "[[source]]\nname = 'a'",
    ],
)
def test_the_schema_refuses_what_is_refused(
    validator: jsonschema.Draft202012Validator, text: str
) -> None:
    head = 'schema = 1\nname = "axis"\nmodel = { kind = "drive" }\n'
    validator.validate(tomllib.loads(head))
    assert not validator.is_valid(tomllib.loads(head + text))


@pytest.mark.parametrize("path", TWINS, ids=lambda path: path.stem)
def test_every_shipped_twin_file_fits(
    validator: jsonschema.Draft202012Validator, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("EVERTWIN_DATA", "data")
    validator.validate(tomllib.loads(path.read_text(encoding="utf-8")))
    assert read(path).name


@pytest.mark.parametrize("form", [TWIN, BREAKDOWN, SCENARIO], ids=lambda form: form.title)
def test_every_setting_is_explained(form: Form[Any]) -> None:
    content, text = schema(form), page(form)
    for section in (content, *content["$defs"].values()):
        assert section["description"]
        table = section.get("anyOf", [section])[0]
        for key, node in table.get("properties", {}).items():
            assert node["description"], key
            assert f"| `{key}` |" in text


@pytest.mark.parametrize("form", [TWIN, BREAKDOWN, SCENARIO], ids=lambda form: form.title)
def test_every_size_has_an_upper_bound(form: Form[Any]) -> None:
    """A number that sets how much is allocated or how often something runs is bounded."""

    def unbounded(node: object, place: str) -> list[str]:
        if isinstance(node, list):
            return [found for item in node for found in unbounded(item, place)]
        if not isinstance(node, dict):
            return []
        own = [place] if node.get("type") == "integer" and "maximum" not in node else []
        return own + [found for key, item in node.items() for found in unbounded(item, key)]

    assert not unbounded(schema(form), "")


def test_every_setting_is_read_by_the_loop() -> None:
    """A setting that nothing reads would be a promise that is not kept."""
    package = ROOT / "src" / "evertwin"
    code = "\n".join(
        path.read_text(encoding="utf-8")
        for path in package.rglob("*.py")
        if path.name != "spec.py" and "config" not in path.relative_to(package).parts
    )
    kinds = [kind for _, kind in inspect.getmembers(spec, inspect.isclass)]
    sections = [kind for kind in kinds if issubclass(kind, Section) and kind is not Section]
    assert len(sections) >= 24
    read_nowhere = [
        f"{kind.__name__}.{setting.name}"
        for kind in sections
        for setting in settings(kind)
        if not re.search(rf"\.{setting.name}\b", code)
    ]
    assert not read_nowhere
