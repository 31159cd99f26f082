"""How the functions of the fused loops are compiled."""

from __future__ import annotations

from typing import Any

COLD: dict[str, Any] = {"cache": True, "error_model": "numpy"}
"""Options of a compiled function that only compiled functions call."""
HOT: dict[str, Any] = {**COLD, "forceinline": True}
"""The same for what runs at every row."""
