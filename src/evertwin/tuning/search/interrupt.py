"""Ctrl-C as a request: the search ends after the roll-out that runs, and keeps what it has.

An exception from a signal could fall into compiled code or into a callback of it, where it is lost.
So the first Ctrl-C only sets a flag; a second one does what it did before.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any


class Interrupt:
    """Within it, the first Ctrl-C sets `asked`; only in the main thread, and only if ``on``.

    >>> with Interrupt(on=True) as stop:
    ...     signal.raise_signal(signal.SIGINT)
    >>> stop.asked
    True
    """

    def __init__(self, on: bool = True) -> None:
        self.asked = False
        self._on = on
        self._before: Any = None

    def __enter__(self) -> Interrupt:
        if self._on and threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        self._restore()

    def _restore(self) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
            self._before = None

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._restore()
