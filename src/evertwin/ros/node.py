"""A node at a ROS master, as a child process that is shared and may die.

    async with node_at(Place()) as node:
        heard = node.subscribe("/odom")
        raw = await heard.next()

All who ask for the same master in one event loop have the same node; it ends with the last of them.
When the process dies, everyone who waits on it gets `NodeDown` with the reason, and whoever comes
back first starts a new one. What waits for a slow reader is bounded: beyond `WAITING` messages the
oldest is dropped and counted.
"""

from __future__ import annotations

import asyncio
import json
import os
from asyncio.subprocess import PIPE, Process
from collections import Counter, deque
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from importlib.resources import files
from typing import Any, NamedTuple

from evertwin.ros.spec import Place

WAITING = 1000
"""Messages that wait for a reader, and lines that wait for the child, at most."""
LARGEST = 1 << 26
"""Bytes of the largest message that is taken."""
LATE = 10.0
"""Seconds that the node may take to be known by the master."""
LEAVES = 3.0
"""Seconds that it may take to say goodbye."""
SELF = ("localhost", "127.0.0.1", "::1")


class NodeDown(ConnectionError):
    """The node is gone, for a reason.

    >>> str(NodeDown("the master is gone"))
    'the master is gone'
    """


class Raw(NamedTuple):
    """A message as it came.

    >>> Raw("/v", "std_msgs/Float64", "float64 data", "/pump", 5, b"").publisher
    '/pump'
    """

    topic: str
    type: str
    definition: str
    publisher: str
    """Name of the node that said it."""
    at: int
    """When it came, by the clock of ROS (a simulated one, if the master says so) [ns]; 0: that
    clock does not run yet."""
    data: bytes


class Subscription:
    """The messages of one topic.

    >>> Subscription("/odom", 1).dropped
    0
    """

    def __init__(self, topic: str, number: int) -> None:
        self.topic, self.number = topic, number
        self.dropped = 0
        """Messages that waited here too long."""
        self._waiting: deque[Raw] = deque()
        self._ended: NodeDown | None = None
        self._came = asyncio.Event()

    async def next(self) -> Raw:
        """The next message.

        Raises:
            NodeDown: the node is gone.
        """
        while not self._waiting:
            if self._ended is not None:
                raise self._ended
            self._came.clear()
            await self._came.wait()
        return self._waiting.popleft()

    def put(self, raw: Raw) -> None:
        """One more came."""
        if len(self._waiting) >= WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(raw)
        self._came.set()

    def end(self, reason: NodeDown) -> None:
        """None will come."""
        self._ended = reason
        self._came.set()


class Node:
    """The child process, usually had from `node_at`.

    >>> async def counts():
    ...     return dict(Node(Place(), "evertwin").counts)
    >>> asyncio.run(counts())
    {}
    """

    def __init__(self, place: Place, name: str) -> None:
        self.place, self.name = place, name
        self.counts: Counter[str] = Counter()
        """Messages sent; dropped because the node was slow; refused by it."""
        self.refused = ""
        """The newest thing that the child would not do."""
        self.known = ""
        """Name by which the master knows it, once it is ready."""
        self.ended: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        """Why there is no node any more."""
        self._ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._heard: dict[int, Subscription] = {}
        self._said: set[str] = set()
        self._publishers: dict[int, Mapping[str, str]] = {}
        self._process: Process | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._lines: asyncio.Queue[bytes] = asyncio.Queue(WAITING)
        self._last = ""
        """What it said on stderr."""

    async def open(self) -> None:
        """Starts the child and waits until the master knows it.

        Raises:
            NodeDown, OSError, TimeoutError: it did not work.
        """
        async with asyncio.timeout(LATE):
            await self._look()
            starts = asyncio.ensure_future(asyncio.create_subprocess_exec(
                self.place.python, str(files("evertwin.ros") / "child.py"), self.name,
                stdin=PIPE, stdout=PIPE, stderr=PIPE, env=_environment(self.place),
            ))  # fmt: skip
            try:
                await asyncio.shield(starts)
            finally:  # given up meanwhile, it is there all the same, to be closed
                self._process = await starts
                self._tasks = [
                    asyncio.create_task(one)
                    for one in (self._reads(), self._writes(), self._listens())
                ]
            await asyncio.wait({self._ready, self.ended}, return_when=asyncio.FIRST_COMPLETED)
        if self.ended.done():
            raise NodeDown(self.ended.result())

    async def _look(self) -> None:
        """Is anybody there? It costs less than a process."""
        try:
            _, line = await asyncio.open_connection(*self.place.address)
        except OSError as error:
            raise NodeDown(f"no master at {self.place.master}: {error.strerror}") from None
        line.close()

    async def close(self) -> None:
        """Says goodbye, and sees that the child is gone."""
        self._end("closed")
        process = self._process
        if process is not None:
            assert process.stdin is not None
            process.stdin.close()
            try:
                async with asyncio.timeout(LEAVES):
                    await process.wait()
            except TimeoutError:
                pass
            finally:
                if process.returncode is None:
                    process.kill()
                    await asyncio.shield(process.wait())
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # ------------------------------------------------------------------ what it is asked for

    def subscribe(self, topic: str) -> Subscription:
        """Hears a topic from now on."""
        number = max(self._heard, default=0) + 1
        found = self._heard[number] = Subscription(topic, number)
        if self.ended.done():
            found.end(NodeDown(self.ended.result()))
        self._tell({"subscribe": topic, "number": number})
        return found

    def leave(self, heard: Subscription) -> None:
        """Hears it no longer."""
        if self._heard.pop(heard.number, None) is not None:
            self._tell({"unsubscribe": heard.number})

    def advertise(self, topic: str, kind: str, *, latch: bool = False) -> None:
        """Says that messages of this type come; ``latch``: the newest waits for who comes late."""
        if topic not in self._said:
            self._said.add(topic)
            self._tell({"advertise": topic, "type": kind, "latch": latch})

    def publish(self, topic: str, content: Mapping[str, Any]) -> None:
        """A message of an advertised topic, by its fields; what is not named is zero."""
        self._tell({"publish": topic, "content": content})

    def _tell(self, order: Mapping[str, Any]) -> None:
        line = json.dumps(order, separators=(",", ":")).encode() + b"\n"
        if self._lines.full():
            self.counts["dropped"] += 1
        else:
            self._lines.put_nowait(line)
            self.counts["sent"] += "publish" in order

    # ------------------------------------------------------------------ the child

    async def _writes(self) -> None:
        assert self._process is not None and self._process.stdin is not None
        with suppress(ConnectionError):
            while True:
                self._process.stdin.write(await self._lines.get())
                await self._process.stdin.drain()

    async def _listens(self) -> None:
        assert self._process is not None and self._process.stderr is not None
        while piece := await self._process.stderr.read(4096):
            lines = (self._last + piece.decode(errors="replace")).strip().splitlines()
            self._last = lines[-1][-200:] if lines else ""

    async def _reads(self) -> None:
        assert self._process is not None and self._process.stdout is not None
        out, reason = self._process.stdout, ""
        try:
            while head := await out.readline():
                told = json.loads(head)
                size = told.get("size", 0)
                if size > LARGEST:
                    reason = f"a message of {size} bytes"
                    break
                self._take(told, await out.readexactly(size))
        except (asyncio.IncompleteReadError, ValueError, LookupError) as error:
            reason = f"the node's process broke off ({type(error).__name__})"
        if not reason and not self.ended.done():
            code = await self._process.wait()
            reason = f"the node's process ended with {code}: {self._last}".rstrip(": ")
        self._end(reason)

    def _take(self, told: Mapping[str, Any], data: bytes) -> None:
        if "message" in told:
            about = self._publishers[told["publisher"]]
            heard = self._heard.get(told["message"])
            if heard is not None:
                heard.put(Raw(
                    heard.topic, about["type"], about["definition"], about["name"], told["at"],
                    data,
                ))  # fmt: skip
        elif "publisher" in told:
            self._publishers[told["publisher"]] = told
        elif "refused" in told:
            self.counts["refused"] += 1
            self.refused = f"{told['refused']}: {told['why']}"
        elif "ready" in told:
            self.known = told["ready"]
            self._ready.set_result(self.known)
        elif "ended" in told:
            self._end(told["ended"])

    def _end(self, reason: str) -> None:
        if not self.ended.done():
            self.ended.set_result(reason)
            for heard in self._heard.values():
                heard.end(NodeDown(reason))


def _environment(place: Place) -> dict[str, str]:
    """Of the child. At a master on this machine it listens on loopback alone, unless told else."""
    own = {"ROS_MASTER_URI": place.master}
    if place.address[0] in SELF and not {"ROS_IP", "ROS_HOSTNAME"} & set(os.environ):
        own["ROS_IP"] = "127.0.0.1"
    return {**os.environ, **own}


class _Shared:
    def __init__(self, node: Node) -> None:
        self.node, self.users = node, 0
        self.opening = asyncio.ensure_future(node.open())

    async def close(self) -> None:
        """Ends what opens it, and closes it, whoever is cancelled meanwhile."""
        self.opening.cancel()
        try:
            await asyncio.gather(self.opening, return_exceptions=True)
        finally:
            await self.node.close()


_SHARED: dict[tuple[asyncio.AbstractEventLoop, Place], _Shared] = {}
"""The nodes that live, by event loop and master."""


@asynccontextmanager
async def node_at(place: Place, name: str = "evertwin") -> AsyncIterator[Node]:
    """The node at a master, while the block lasts. ``name``: of a new one, made unique.

    Raises:
        NodeDown, OSError, TimeoutError: no master, no rospy, or no answer.
    """
    key = asyncio.get_running_loop(), place
    shared = _SHARED.get(key)
    if shared is None or shared.node.ended.done():
        shared = _SHARED[key] = _Shared(Node(place, name))
    shared.users += 1
    try:
        await asyncio.shield(shared.opening)
        yield shared.node
    finally:
        shared.users -= 1
        if not shared.users:
            if _SHARED.get(key) is shared:
                del _SHARED[key]
            await asyncio.shield(shared.close())
