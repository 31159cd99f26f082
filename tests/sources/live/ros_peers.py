"""A real ROS 1 master and Debian's own nodes, each in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import time
import xmlrpc.client
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.sources.live.peers import free_port, listening, need

STATES = Path("/usr/lib/robot_state_publisher/robot_state_publisher")


class Master:
    """A rosmaster that can be killed and started again at the same port."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"
        self.environment = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_IP": "127.0.0.1",
                            "ROS_LOG_DIR": str(folder), "HOME": str(folder)}  # fmt: skip
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            ["rosmaster", "--core", "-p", str(self.port)], env=self.environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        listening(self.port)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    @contextmanager
    def node(self, *command: str) -> Iterator[subprocess.Popen[bytes]]:
        """A program of ROS at this master; ends in order with the block."""
        peer = subprocess.Popen(command, env=self.environment, start_new_session=True,
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        try:
            yield peer
        finally:
            os.killpg(peer.pid, signal.SIGINT)
            try:
                peer.wait(5)
            except subprocess.TimeoutExpired:
                os.killpg(peer.pid, signal.SIGKILL)
                peer.wait()

    @contextmanager
    def recording(self, bag: Path, *topics: str) -> Iterator[None]:
        """rosbag, from when it listens to every topic until its file is whole."""
        with self.node("rosbag", "record", "-O", str(bag), *topics):
            until(lambda: self.state()[1].keys() >= set(topics))
            yield
        until(bag.exists)  # the recorder ends after the program that started it

    def state(self) -> list[dict[str, list[str]]]:
        """Publishers and subscribers of each topic."""
        with xmlrpc.client.ServerProxy(self.uri) as asked:
            told: Any = asked.getSystemState("/test")
        return [dict(part) for part in told[2]]

    def connected(self, topic: str) -> int:
        """Subscribers that a publisher of the topic is connected to."""
        found = 0
        for node in self.state()[0].get(topic, ()):
            with xmlrpc.client.ServerProxy(self.uri) as asked:
                told: Any = asked.lookupNode("/test", node)
            with xmlrpc.client.ServerProxy(told[2]) as asked:
                lines: Any = asked.getBusInfo("/test")
            found += sum(line[2] == "o" and line[4] == topic for line in lines[2])
        return found

    def says(self, topic: str, kind: str, content: str) -> Sequence[str]:
        """The command that publishes fifty times a second, stamped (``header: auto``)."""
        return ("rostopic", "pub", "-s", "-r", "50", topic, kind, content)


def until(done: Callable[[], bool], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "too late"
        time.sleep(0.02)


@contextmanager
def master(folder: Path) -> Iterator[Master]:
    need("rosmaster", "rostopic", "rosbag")
    if not STATES.exists():
        pytest.skip("peer absent: robot_state_publisher is not installed")
    found = Master(folder)
    try:
        yield found
    finally:
        found.kill()
