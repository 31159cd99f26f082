"""Peers in processes of their own, and a line between them and us that can be spoilt."""

from __future__ import annotations

import asyncio
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from evertwin.fold import Chunk
from evertwin.sources.live import LiveSource

HERE = Path(__file__).parent


def need(*programs: str) -> None:
    """Skips by name where a peer could not be installed."""
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"peer absent: {program} is not installed")


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def listening(port: int, seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.2):
            return
        time.sleep(0.02)
    raise TimeoutError(f"nobody listens on {port}")


@contextmanager
def process(port: int, *command: str) -> Iterator[subprocess.Popen[bytes]]:
    """A peer that listens on a port."""
    peer = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        listening(port)
        yield peer
    finally:
        peer.kill()
        peer.wait()


class Proxy:
    """A line that can be cut (`cut`), or swallow what comes while it looks whole (`deaf`)."""

    def __init__(self, target: int) -> None:
        self.target = target
        self.deaf = False
        self.refuse = False
        self.port = free_port()
        self._loop = asyncio.new_event_loop()
        self._lines: set[asyncio.StreamWriter] = set()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Proxy:
        self._thread.start()
        listening(self.port)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def cut(self) -> None:
        """Every line that stands is cut."""
        for line in list(self._lines):
            self._loop.call_soon_threadsafe(line.close)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        serving = asyncio.start_server(self._serve, "127.0.0.1", self.port)
        server = self._loop.run_until_complete(serving)
        self._loop.run_forever()
        server.close()
        for line in self._lines:
            line.transport.abort()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0.01))
        self._loop.close()

    async def _serve(self, here: asyncio.StreamReader, back: asyncio.StreamWriter) -> None:
        if self.refuse:
            back.transport.abort()
            return
        with suppress(OSError, asyncio.CancelledError):
            there, forth = await asyncio.open_connection("127.0.0.1", self.target)
            self._lines |= {back, forth}
            await asyncio.gather(self._pump(here, forth), self._pump(there, back))

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.CancelledError):
            while data := await reader.read(65536):
                if not self.deaf:
                    writer.write(data)
                    await writer.drain()
        writer.close()
        self._lines.discard(writer)


def listen(
    source: LiveSource, until: Callable[[list[Chunk]], bool], seconds: float = 15.0
) -> list[Chunk]:
    """What a source gives until something holds; each chunk is committed at once."""
    return asyncio.run(hear(source, until, seconds))


async def hear(
    source: LiveSource, until: Callable[[list[Chunk]], bool], seconds: float = 15.0
) -> list[Chunk]:
    given: list[Chunk] = []
    source.open()

    async def read() -> None:
        async for chunk in source.chunks():
            given.append(chunk)
            source.committed(chunk)

    reading = asyncio.create_task(read())
    end = time.monotonic() + seconds
    while not until(given) and time.monotonic() < end and not reading.done():
        await asyncio.sleep(0.01)
    held = until(given)
    source.close()
    await asyncio.wait_for(reading, 5.0)
    assert held, f"{len(given)} chunks after {seconds} s, {source.health}"
    return given
