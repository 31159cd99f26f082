"""Libraries of the extra ``formats``, imported with the file that needs them.

>>> load("json").__name__
'json'
"""

from __future__ import annotations

import importlib
from typing import Any

from evertwin.errors import MissingExtra


def load(module: str, extra: str = "formats") -> Any:
    """The module, or one line that says what to install.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is not None and module.split(".")[0] != error.name.split(".")[0]:
            raise
        raise MissingExtra.of(module.split(".")[0], extra) from None
