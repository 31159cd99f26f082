"""The JSON schema and the reference page agree with what is read."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import jsonschema
import pytest

from evertwin.config import read
from evertwin.config.page import page
from evertwin.config.schema import schema, sections
from evertwin.settings.fields import field_docs, section_doc, settings

ROOT = Path(__file__).parent.parent.parent
TWINS = sorted((ROOT / "twins").glob("*.toml"))


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    content = schema()
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


def test_every_setting_is_explained() -> None:
    silent = [
        f"{kind.__name__}.{setting.name}"
        for kind in sections()
        for setting in settings(kind)
        if not field_docs(kind).get(setting.name)
    ]
    assert not silent
    assert all(section_doc(kind) for kind in sections())


def test_every_setting_stands_on_the_page() -> None:
    text = page()
    for kind in sections():
        for setting in settings(kind):
            assert f"| `{setting.key}` |" in text


def test_every_setting_is_read_by_the_loop() -> None:
    """A setting that nothing reads would be a promise that is not kept."""
    package = ROOT / "src" / "evertwin"
    code = "\n".join(
        path.read_text(encoding="utf-8")
        for path in package.rglob("*.py")
        if "config" not in path.relative_to(package).parts
    )
    read_nowhere = [
        f"{kind.__name__}.{setting.name}"
        for kind in sections()
        for setting in settings(kind)
        if not re.search(rf"\.{setting.name}\b", code)
    ]
    assert not read_nowhere
