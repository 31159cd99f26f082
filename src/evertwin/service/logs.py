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


def log_to_stderr(form: str) -> None:
    """Logs of the service to stderr: ``json`` or ``text``."""
    handler = logging.StreamHandler(sys.stderr)
    text = _Text("%(asctime)s %(levelname)s %(message)s")
    handler.setFormatter(Lines() if form == "json" else text)
    logging.basicConfig(handlers=[handler], level=logging.INFO, force=True)
    for noisy in ("asyncua", "uvicorn.access", "pymodbus", "httpx", "numba"):
        logging.getLogger(noisy).setLevel(logging.WARNING)
