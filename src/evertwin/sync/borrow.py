"""Arrays without reference counts, for compiled loops that pass many of them on.

Numba counts references to an array atomically, at each call and each assignment; in a loop that
judges one row after the other this costs more than the judging. A borrowed array is the same array
without an owner: whoever borrows must not outlive who lends.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils
from numba.extending import intrinsic

COLD: dict[str, Any] = {
    "cache": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True,
}  # fmt: skip
"""Options of a compiled function that only compiled functions call."""
HOT: dict[str, Any] = {**COLD, "forceinline": True}
"""The same for what runs at every row."""


@intrinsic
def borrowed(typing: Any, array: Any) -> Any:
    """The array without an owner."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, arguments[0])
        view.meminfo = cgutils.get_null_value(view.meminfo.type)
        view.parent = cgutils.get_null_value(view.parent.type)
        return view._getvalue()

    return array(array), code
