"""A ROS 1 node that does as it is told on stdin and says on stdout what it hears.

It runs under the Python that has rospy (Debian's, or that of /opt/ros), which is not ours: nothing
of evertwin can be imported here. Both ways a message is one line of JSON; a message of a topic is
followed by its bytes as they came, undecoded.

    in    {"subscribe": TOPIC, "number": N}   {"unsubscribe": N}
          {"advertise": TOPIC, "type": TYPE, "latch": false}
          {"publish": TOPIC, "content": {...}}
    out   {"ready": NODE}
          {"publisher": P, "topic": TOPIC, "type": ..., "definition": ..., "name": ...}  once each
          {"message": N, "publisher": P, "at": NS, "size": BYTES} + the bytes
          {"refused": TOPIC, "why": REASON}
          {"ended": REASON}

It ends when stdin ends, when the master was started anew (what it knew of this node is gone), when
the clock of ROS becomes a simulated one or the wall's again (`/use_sim_time`), and when the master
is gone and nothing was heard for a while. While a master is gone nodes still hear
each other.
"""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import threading
import time
import xmlrpc.client
from typing import Any, NoReturn

QUEUE = 100
"""Messages of ours that wait at most for each who listens."""
LOOK = 1.0
"""Seconds between two looks at the master."""
QUIET = 3.0
"""Seconds without a message after which a node whose master is gone ends."""


class _Out:
    """The one way to the parent, from any thread."""

    def __init__(self) -> None:
        self._file = os.fdopen(os.dup(1), "wb")
        os.dup2(2, 1)  # what others print is no message
        self._turn = threading.Lock()

    def say(self, head: dict[str, Any], data: bytes = b"") -> None:
        with self._turn:
            self._file.write(json.dumps(head).encode() + b"\n" + data)
            self._file.flush()


class _Node:
    """What is subscribed and advertised."""

    def __init__(self, out: _Out, rospy: Any) -> None:
        self.out, self.rospy = out, rospy
        self.heard = time.monotonic()
        self._subscribers: dict[int, Any] = {}
        self._publishers: dict[str, tuple[Any, Any]] = {}
        self._known: dict[tuple[str, str, str], int] = {}
        self._turn = threading.Lock()

    def subscribe(self, topic: str, number: int) -> None:
        self._subscribers[number] = self.rospy.Subscriber(
            topic, self.rospy.AnyMsg, self._came, callback_args=(topic, number), tcp_nodelay=True
        )

    def unsubscribe(self, number: int) -> None:
        self._subscribers.pop(number).unregister()

    def _came(self, message: Any, about: tuple[str, int]) -> None:
        topic, number = about
        self.heard = time.monotonic()
        at = self.rospy.get_rostime().to_nsec()
        publisher = self._publisher(topic, message._connection_header)
        data = bytes_of(message)
        head = {"message": number, "publisher": publisher, "at": at, "size": len(data)}
        self.out.say(head, data)

    def _publisher(self, topic: str, header: dict[str, str]) -> int:
        name = header.get("callerid", "")
        key = (topic, name, header["md5sum"])
        with self._turn:
            if key not in self._known:
                self._known[key] = len(self._known)
                self.out.say({
                    "publisher": self._known[key], "topic": topic, "type": header["type"],
                    "definition": header.get("message_definition", ""), "name": name,
                })  # fmt: skip
        return self._known[key]

    def advertise(self, topic: str, kind: str, latch: bool) -> None:
        import roslib.message

        form = roslib.message.get_message_class(kind)
        if form is None:
            self.out.say({"refused": topic, "why": f"no package here defines {kind}"})
            return
        self._publishers[topic] = (
            form,
            self.rospy.Publisher(topic, form, latch=latch, queue_size=QUEUE, tcp_nodelay=True),
        )

    def publish(self, topic: str, content: dict[str, Any]) -> None:
        import genpy

        form, publisher = self._publishers.get(topic, (None, None))
        if form is None:
            return
        try:
            message = form()
            genpy.message.fill_message_args(message, [content])
            publisher.publish(message)
        except (genpy.MessageException, ValueError, TypeError, AttributeError) as error:
            self.out.say({"refused": topic, "why": str(error)})

    def told(self, order: dict[str, Any]) -> None:
        if "publish" in order:
            self.publish(order["publish"], order["content"])
        elif "subscribe" in order:
            self.subscribe(order["subscribe"], order["number"])
        elif "unsubscribe" in order:
            self.unsubscribe(order["unsubscribe"])
        elif "advertise" in order:
            self.advertise(order["advertise"], order["type"], order["latch"])


def bytes_of(message: Any) -> bytes:
    """As it came; rospy itself hears /clock, and hands it to all in its decoded form."""
    if hasattr(message, "_buff"):
        return bytes(message._buff)
    out = io.BytesIO()
    message.serialize(out)
    return out.getvalue()


def knows(uri: str, name: str) -> bool | None:
    """Does the master know this node? None where it does not answer."""
    try:
        master: Any = xmlrpc.client.ServerProxy(uri)
        return bool(master.lookupNode("/evertwin", name)[0] == 1)
    except (OSError, xmlrpc.client.Error, ValueError, LookupError):
        return None


def simulated(uri: str) -> bool | None:
    """Is the clock of ROS a simulated one? None where the master does not answer."""
    try:
        master: Any = xmlrpc.client.ServerProxy(uri)
        code, _, value = master.getParam("/evertwin", "/use_sim_time")
        return bool(code == 1 and value)
    except (OSError, xmlrpc.client.Error, ValueError, LookupError):
        return None


def watch(uri: str, node: _Node, clock: bool | None) -> None:
    """Ends the process with a reason once there is one. ``clock``: `simulated` at its start."""
    name = node.rospy.get_name()
    while True:
        time.sleep(LOOK)
        known = knows(uri, name)
        if node.rospy.is_shutdown():
            end(node.out, "another node asked this one to end")
        if known is False:
            end(node.out, "the master was started anew")
        if known and clock is not None and simulated(uri) not in (clock, None):
            end(
                node.out, "/use_sim_time was changed: another clock of ROS"
            )  # rospy never looks again
        if known is None and time.monotonic() > node.heard + QUIET:
            end(node.out, "the master is gone")


def end(out: _Out, reason: str) -> NoReturn:
    """Ends the process, and says why."""
    try:
        out.say({"ended": reason})
    finally:
        os._exit(0)


def main() -> None:
    """The node until stdin ends."""
    name = sys.argv[1]
    out = _Out()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent's: it closes stdin
    uri = os.environ["ROS_MASTER_URI"]
    try:
        import rospy
    except ImportError as error:
        end(out, f"{error} in {sys.executable}: apt-get install python3-rospy")
    if knows(uri, "/") is None:
        end(out, f"no master at {uri}")
    rospy.core.configure_logging = lambda *_: None  # else a log file for each start, kept for good
    clock = simulated(uri)
    rospy.init_node(name, argv=[name], anonymous=True, disable_signals=True, disable_rosout=True)
    node = _Node(out, rospy)
    threading.Thread(target=watch, args=(uri, node, clock), daemon=True).start()
    out.say({"ready": rospy.get_name()})
    for line in sys.stdin:
        node.told(json.loads(line))
    leaving = threading.Thread(target=rospy.signal_shutdown, args=("done",), daemon=True)
    leaving.start()
    leaving.join(1.0)
    os._exit(0)


if __name__ == "__main__":
    main()
