"""What systemd is told: one datagram to the socket that it names.

>>> notify("READY=1", "")
False
"""

from __future__ import annotations

import os
import socket


def notify(text: str, address: str | None = None) -> bool:
    """Tells it, where there is somebody to tell.

    Args:
        text: ``READY=1``, ``STOPPING=1``, ``WATCHDOG=1``, ``RELOADING=1``, …
        address: of the socket; None: what NOTIFY_SOCKET says.
    """
    where = os.environ.get("NOTIFY_SOCKET", "") if address is None else address
    if not where:
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as line:
        line.setblocking(False)  # who does not listen keeps nobody waiting
        try:
            line.connect("\0" + where[1:] if where.startswith("@") else where)
            line.sendall(text.encode())
        except OSError:
            return False  # whoever asked to be told is gone, or listens to nothing
    return True


def beat_of() -> float | None:
    """Seconds between two beats that systemd expects; None: it expects none."""
    told = os.environ.get("WATCHDOG_USEC", "")
    return int(told) / 2e6 if told.isdigit() and int(told) > 0 else None
