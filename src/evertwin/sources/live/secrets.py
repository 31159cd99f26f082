"""Passwords come from the environment or from a file of their own, never from a site file.

>>> password("source 'robot'", None, None) is None
True
"""

from __future__ import annotations

import os
from pathlib import Path

from evertwin.errors import UsageError


def password(who: str, env: str | None, file: Path | None) -> str | None:
    """The password in a variable or file; None where neither is named.

    Raises:
        UsageError: it cannot be read.
    """
    if env is not None:
        if env not in os.environ:
            raise UsageError(
                f"{who}: the environment variable {env} is not set: it holds the password"
            )
        return os.environ[env]
    if file is None:
        return None
    try:
        return file.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise UsageError(f"{who}: {file}: the password cannot be read: {error.strerror}") from None
