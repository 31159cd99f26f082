"""A real browser for proofs: Debian's Chromium, driven by playwright."""

from __future__ import annotations

import shutil
import sys
from typing import Any


def chromium() -> tuple[str, Any] | None:
    """The program and the driver's opener; None, and it is said, where one of them is absent."""
    program = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        program = None
    if program is None:
        sys.stdout.write("no Chromium, or no playwright: nothing to look with\n")
        return None
    return program, sync_playwright
