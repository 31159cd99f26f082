"""Structured logs: one JSON object a line, with what belongs to it and without secrets.

>>> import logging
>>> record = logging.LogRecord("evertwin", logging.INFO, "", 0, "asked with Bearer abc", (), None)
>>> json.loads(Lines().format(record))["message"]
'asked with Bearer ***'
"""

from __future__ import annotations

import json
import logging
import re
import sys
from collections import deque
from datetime import UTC, datetime

SECRET = re.compile(
    r"(?i)\b(bearer[ .]|(?:password|token|secret)[\"']?\s*[=:]\s*[\"']?)[^\s\"',;]+"
)
KEPT = ("twin", "event", "row", "person")


def hidden(text: str) -> str:
    """``text`` without what looks like a secret.

    >>> hidden("password=abc; host=b")
    'password=***; host=b'
    """
    return SECRET.sub(r"\1***", text)


class Lines(logging.Formatter):
    """A record as a line of JSON. See the module for an example."""

    def format(self, record: logging.LogRecord) -> str:
        """The line."""
        when = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        told: dict[str, object] = {
            "time": when, "level": record.levelname.lower(), "logger": record.name,
            "message": hidden(record.getMessage()),
        }  # fmt: skip
        told |= {key: getattr(record, key) for key in KEPT if hasattr(record, key)}
        if record.exc_info:
            told["trace"] = hidden(self.formatException(record.exc_info))
        return json.dumps(told, default=str)


class _Text(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        return hidden(super().format(record))


def _new(record: logging.LogRecord) -> bool:
    """What a twin's run says in passing the service says again, with the twin's name."""
    return record.name != "evertwin" or record.levelno > logging.INFO


def log_to_stderr(form: str) -> None:
    """Logs of the service to stderr: ``json`` or ``text``."""
    handler = logging.StreamHandler(sys.stderr)
    text = _Text("%(asctime)s %(levelname)s %(message)s")
    handler.setFormatter(Lines() if form == "json" else text)
    handler.addFilter(_new)
    logging.basicConfig(handlers=[handler], level=logging.INFO, force=True)
    for noisy in ("asyncua", "uvicorn.access", "pymodbus", "httpx", "numba"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


class Newest(logging.Handler):
    """The newest lines of the log, for whoever looks.

    >>> newest = Newest()
    >>> newest.emit(logging.LogRecord("evertwin", logging.INFO, "", 0, "token=abc", (), None))
    >>> [(line["number"], line["message"]) for line in newest.after(0)]
    [(1, 'token=***')]
    """

    def __init__(self, most: int = 1000) -> None:
        super().__init__(logging.INFO)
        self.addFilter(_new)
        self._lines: deque[dict[str, object]] = deque(maxlen=most)
        self._count = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Keeps one."""
        self._count += 1
        kept = {key: getattr(record, key) for key in KEPT if hasattr(record, key)}
        self._lines.append({
            "number": self._count, "time": record.created, "level": record.levelname.lower(),
            "message": hidden(record.getMessage()), **kept,
        })  # fmt: skip

    def after(self, number: int) -> list[dict[str, object]]:
        """Those behind a number."""
        return [line for line in list(self._lines) if int(str(line["number"])) > number]
