"""From a file's text to its checked content, with every mistake and its line at once.

>>> from dataclasses import dataclass
>>> @dataclass(frozen=True)
... class Pump(Section):
...     name: str
...     schema: int = 1
...     speed: float = 1.0
>>> Form(Pump, 1).parse('schema = 1\\nname = "P1"', "pump.toml").speed
1.0
>>> Form(Pump, 1).parse('schema = 1\\nname = "P1"\\nsped = 2', "pump.toml")
Traceback (most recent call last):
evertwin.errors.ConfigError: pump.toml:3: unknown key 'sped', did you mean 'speed'?
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from evertwin.errors import ConfigError
from evertwin.settings.decode import decode
from evertwin.settings.document import LARGEST, Document
from evertwin.settings.section import Section

S = TypeVar("S", bound=Section)


@dataclass(frozen=True)
class Form(Generic[S]):
    """A kind of file. See the module for an example."""

    root: type[S]
    """Class of the whole file; it has a field ``schema``."""
    version: int
    """Version of the form that this evertwin reads; the file states its own as ``schema``."""
    title: str = "file"
    """What such a file is called in messages."""
    about: str = ""
    """What opens its reference page (Markdown)."""

    def load(self, path: str | Path) -> str:
        """The text of the file at ``path``.

        Raises:
            ConfigError: the file cannot be read.
        """
        file = Path(path)
        try:
            if file.stat().st_size > LARGEST:
                raise ConfigError(
                    f"{file}: over {LARGEST} bytes: expected a {self.title}, not a recording"
                )
            return file.read_text(encoding="utf-8-sig")
        except OSError as error:
            raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise ConfigError(f"{file}: expected UTF-8 text, byte {error.start} is not") from error

    def parse(self, text: str, name: str = "") -> S:
        """The content of ``text``; ``name`` (by default the title) stands in messages.

        Raises:
            ConfigError: it does not say what it must; the message has one line for each problem,
                ``name:line: what was expected, what came``.
        """
        return decode(self.root, self.document(text, name))

    def document(self, text: str, name: str = "") -> Document:
        """The values of ``text``, their form's version checked and nothing else yet.

        Raises:
            ConfigError: it is no TOML, or of a newer form.
        """
        name = name or self.title
        document = Document(text, name, self.title)
        version = document.table.get("schema")
        if version is None:
            raise ConfigError(
                f"{name}:1: needs 'schema = {self.version}': the version of the file's form"
            )
        if isinstance(version, int) and version > self.version:
            raise ConfigError(
                f"{name}: has schema {version}, this evertwin reads up to {self.version}: "
                "upgrade evertwin"
            )
        return document
