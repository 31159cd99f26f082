"""What is published at a master, and whose clock is followed there."""

from __future__ import annotations

import asyncio
import xmlrpc.client
from http.client import HTTPConnection
from typing import Any

from evertwin.ros.node import NodeDown
from evertwin.ros.spec import Place

LATE = 5.0
"""Seconds that the master may take to answer."""


async def topics_of(place: Place) -> dict[str, str]:
    """Topics with somebody who publishes them, and their types.

    Raises:
        NodeDown: the master does not answer.
    """
    return await asyncio.to_thread(_asked, place.master)


async def simulate(place: Place) -> None:
    """The clock of ROS is a simulated one, of ``/clock``, from now on.

    Raises:
        NodeDown: the master does not answer.
    """
    await asyncio.to_thread(_simulated, place.master)


class _Transport(xmlrpc.client.Transport):
    """One that does not wait for ever."""

    def make_connection(self, host: Any) -> HTTPConnection:
        line = super().make_connection(host)
        line.timeout = LATE
        return line


def _simulated(uri: str) -> None:
    try:
        with xmlrpc.client.ServerProxy(uri, _Transport()) as master:
            master.setParam("/evertwin", "/use_sim_time", True)
    except (OSError, xmlrpc.client.Error, ValueError) as error:
        raise NodeDown(f"no master at {uri}: {error}") from None


def _asked(uri: str) -> dict[str, str]:
    try:
        with xmlrpc.client.ServerProxy(uri, _Transport()) as master:
            found: Any = master.getPublishedTopics("/evertwin", "")
        return {str(topic): str(kind) for topic, kind in sorted(found[2])}
    except (OSError, xmlrpc.client.Error, ValueError, LookupError, TypeError) as error:
        raise NodeDown(f"the master at {uri} does not answer: {error}") from None
