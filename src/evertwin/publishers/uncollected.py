"""What stays for long is built without looking for garbage in between.

The collector walks through all that there is, again and again while hundreds of thousands of
objects are made, and every thread waits for it.

>>> with uncollected():
...     gc.isenabled()
False
>>> gc.isenabled()
True
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_LOCK, _BUILDING = threading.Lock(), set[object]()


@contextmanager
def uncollected() -> Iterator[None]:
    """None is looked for in the block, nor later among what there is at its end."""
    own = object()
    with _LOCK:
        _BUILDING.add(own)
        gc.disable()
    try:
        yield
    finally:
        with _LOCK:
            _BUILDING.discard(own)
            if not _BUILDING:
                gc.freeze()
                gc.enable()
