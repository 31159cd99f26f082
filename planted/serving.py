"""A service in a process of its own, and what is asked of it."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evertwin.service.twin.runner import CLOSES

TWINS = Path(__file__).parent.parent / "twins"
ENTRY = """
[[twin]]
file = "robot1d.toml"
name = "{name}"
workers = 0
[[twin.source]]
source = "log"
protocol = "replay"
files = ["run.csv"]
speed = {speed}
"""


def site(
    folder: Path, *twins: str, speed: float = 200.0, http: str = "port = 0", workers: int = 0
) -> Path:
    """A site of so many robots, each with the same recording."""
    file = folder / "site.toml"
    (folder / "robot1d.toml").write_text((TWINS / "robot1d.toml").read_text())
    entries = "".join(ENTRY.format(name=name, speed=speed) for name in twins)
    entries = entries.replace("workers = 0", f"workers = {workers}")
    head = f'schema = 1\nname = "hall"\nwarm = {str(workers > 0).lower()}\n[http]\n{http}\n'
    file.write_text(head + entries)
    return file


def nodes(
    folder: Path, server: str, names: tuple[str, ...], twins: tuple[str, ...], *, lease: float,
    speed: float = 20.0,
) -> dict[str, Path]:  # fmt: skip
    """The site files of nodes that share twins: a folder each, as machines have."""
    found = {}
    for name in names:
        own = folder / name
        own.mkdir()
        (own / "run.csv").write_bytes((folder / "run.csv").read_bytes())
        found[name] = site(own, *twins, speed=speed)
        shared = f'[fleet]\nstore = "{server}"\nnode = "{name}"\nlease = {lease}\n'
        found[name].write_text(found[name].read_text().replace("[http]", shared + "[http]"))
    return found


class Served:
    """`evertwin serve` at work; ends with the block."""

    def __init__(self, file: Path, **environment: str) -> None:
        self.file = file
        environment = {**os.environ, "JAXTYPING_DISABLE": "1", **environment}
        words = [sys.executable, "-m", "evertwin", "serve", str(file), "--log", "json"]
        with (file.parent / "log.jsonl").open("a") as log:
            self.process = subprocess.Popen(
                words, stdout=subprocess.PIPE, stderr=log, text=True, env=environment
            )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        self.port = int(self.address.rpartition(":")[2]) if self.address else 0

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.end()

    @property
    def token(self) -> str:
        """What the first start has written down."""
        return (self.file.parent / "store" / "token").read_text().strip()

    def ask(
        self, path: str, body: object = None, token: str | None = None, **headers: str
    ) -> tuple[int, Any]:
        """Status and content of an answer; ``token=""``: without any."""
        told = {"Content-Type": "application/json", **headers}
        token = self.token if token is None else token
        if token:
            told["Authorization"] = f"Bearer {token}"
        data = body if isinstance(body, bytes | None) else json.dumps(body).encode()
        asked = urllib.request.Request(self.address + path, data, told)
        try:
            with urllib.request.urlopen(asked, timeout=20) as answer:
                return answer.status, parsed(answer.read())
        except urllib.error.HTTPError as error:
            with error:
                return error.code, parsed(error.read())

    def until(self, done: Callable[[dict[str, Any]], bool], seconds: float = 30.0) -> Any:
        """The status of the service once it is so."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            status = self.ask("/api/v1/status")[1]
            if status["ready"] and done(status):
                return status
            time.sleep(0.05)
        raise TimeoutError(f"not so after {seconds} s: {status}")

    def twin(self, name: str) -> dict[str, Any]:
        """Status of one."""
        found = next(one for one in self.ask("/api/v1/status")[1]["twins"] if one["name"] == name)
        return dict(found)

    def kill(self) -> None:
        """As a machine does that loses its power."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.process.stdout.close()  # type: ignore[union-attr]

    def end(self) -> int:
        """As systemd does; the exit code. A twin that works at a fit may take as long as the
        service gives it (`evertwin.service.twin.runner.CLOSES`).

        Raises:
            TimeoutError: it does not end; it is killed, and the end of its log is shown.
        """
        self.process.send_signal(signal.SIGTERM)
        try:
            code = self.process.wait(2 * CLOSES)
        except subprocess.TimeoutExpired:
            self.kill()
            last = (self.file.parent / "log.jsonl").read_text().splitlines()[-5:]
            raise TimeoutError("\n".join(["the service does not end:", *last])) from None
        self.process.stdout.close()  # type: ignore[union-attr]
        return code


def parsed(text: bytes) -> Any:
    """Strict JSON; other text as it is."""

    def strange(word: str) -> None:
        raise ValueError(word)

    try:
        return json.loads(text, parse_constant=strange)
    except json.JSONDecodeError:
        return text.decode()


def said_to(folder: Path) -> tuple[socket.socket, dict[str, str]]:
    """A socket as systemd has one, and the environment that names it."""
    line = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    line.bind(str(folder / "notify"))
    line.settimeout(10)
    return line, {"NOTIFY_SOCKET": str(folder / "notify")}
