"""Launching machines that live, and talking to them: each is a process of its own."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import typer

from evertwin.app.machine.recording_processes import failed
from evertwin.errors import DataError, UsageError
from evertwin.ros.spec import Place

LATE = 5.0
"""Seconds that a machine may take to answer an order."""
ENDING = 10.0
"""Seconds in which a machine that is told to end ends by itself."""


class Common(NamedTuple):
    """What both machines are started with.

    >>> Common(seconds=5.0).options()[:4]
    ['--seed', '1', '--speed', '1.0']
    """

    seed: int = 1
    speed: float = 1.0
    start: float | None = None
    seconds: float | None = None
    order: list[str] = []  # noqa: RUF012  (of a named tuple: never changed)
    control: int = 0
    record: Path | None = None

    def options(self) -> list[str]:
        """Of its process.

        Raises:
            UsageError: a recording without end.
        """
        if self.record is not None and self.seconds is None:
            raise UsageError("--record: expected --seconds too, how long the recording shall be")
        named = {
            "--seed": self.seed, "--speed": self.speed, "--start": self.start,
            "--seconds": self.seconds, "--record": self.record,
        }  # fmt: skip
        if self.record is None:
            named["--control"] = self.control
        given = [word for name, value in named.items() if value is not None
                 for word in (name, str(value))]  # fmt: skip
        return given + [word for one in self.order for word in ("--order", one)]


class LiveMachine:
    """A machine in a process of its own; it ends with the block.

    >>> with LiveMachine("arm", ["--help"]) as machine:
    ...     machine.name
    'arm'
    """

    def __init__(self, name: str, options: list[str]) -> None:
        self.name = name
        self._process = subprocess.Popen(
            self.command(name, options), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    @staticmethod
    def command(name: str, options: list[str]) -> list[str]:
        """The words that start it."""
        module = "evertwin.worlds.live" + ".recorder" * ("--record" in options)
        return [sys.executable, "-m", module, name, *options]

    def __enter__(self) -> LiveMachine:
        return self

    def __exit__(self, *_: object) -> None:
        with self._process:  # waits, and closes its pipes
            self._process.terminate()
            try:
                self._process.wait(ENDING)
            except subprocess.TimeoutExpired:
                self._process.kill()

    def reached(self) -> dict[str, str]:
        """What is reached where, once it speaks.

        Raises:
            MissingExtra: what it needs is not installed.
            ModelError: it could not start.
        """
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            _, said = self._process.communicate()
            raise failed(self.name, self._process.returncode, said)
        told: dict[str, str] = json.loads(line)
        return told

    def wait(self) -> None:
        """Until it ends; an interrupt stops it.

        Raises:
            MissingExtra: what it needs is not installed.
            ModelError: it failed.
        """
        previous = signal.signal(signal.SIGTERM, lambda *_: self._process.terminate())
        try:
            _, said = self._process.communicate()
        except KeyboardInterrupt:
            _, said = self._process.communicate()  # it had the interrupt too
        finally:
            signal.signal(signal.SIGTERM, previous)
        if self._process.returncode:
            raise failed(self.name, self._process.returncode, said)


def arm_options(common: Common, modbus: str, opcua: str) -> list[str]:
    """Of the arm's process."""
    urdf = files("evertwin.machines").joinpath("data", "ur5_like.urdf")
    spoken = [
        word for name, at in (("--modbus", modbus), ("--opcua", opcua)) if at for word in (name, at)
    ]
    return [*common.options(), "--urdf", str(urdf), *(() if common.record else spoken)]


def robot_options(
    common: Common, broker: str | None, own: str = "", world: str = "w3", topics: str = "",
    ros: Place | None = None,
) -> list[str]:  # fmt: skip
    """Of the robot's process; ``topics``: with commas between, none for all; ``ros``: it speaks at
    a ROS master in place of a broker."""
    said = ["--topics", *topics.split(",")] if topics else []
    where = ["--own-broker", own] if broker is None else ["--broker", broker]
    if ros is not None:
        where = ["--ros", ros.master, "--python", ros.python]
    speaks = where if common.record is None else []
    return [*common.options(), "--world", world, *said, *speaks]


def run_machine(name: str, options: list[str], common: Common) -> None:
    """A machine until it is stopped; ``options``: of `arm_options` or `robot_options`."""
    with LiveMachine(name, options) as machine:
        if common.record is None:
            reached = machine.reached()
            typer.echo("".join(f"{what}: {where}\n" for what, where in reached.items()), nl=False)
        machine.wait()


def told(where: str, line: str) -> str:
    """The answer of a machine to one line.

    Raises:
        UsageError: the address has another form, or the machine did not follow.
        DataError: nobody answers there.
    """
    host, sign, port = where.rpartition(":")
    if not sign or not port.isdigit():
        raise UsageError(f"expected HOST:PORT, such as 127.0.0.1:5021, got {where!r}")
    try:
        with socket.create_connection((host, int(port)), timeout=LATE) as line_:
            line_.sendall(line.encode() + b"\n")
            line_.shutdown(socket.SHUT_WR)
            with line_.makefile("r") as answers:
                answer = answers.read().strip()
    except OSError as error:
        raise DataError(
            f"no machine answers at {where} ({error}); it says where it takes orders: "
            "evertwin machine arm"
        ) from None
    if answer.startswith("error "):
        raise UsageError(answer.removeprefix("error "))
    return answer


def tell_machine(where: str, orders: list[str]) -> None:
    """Orders to a running machine, or what it knows."""
    typer.echo(told(where, " ".join(orders) or "?"))
