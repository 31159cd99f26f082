"""What a proof of a fleet stands between: lines that can be cut, machines that go on sending."""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import suppress

import numpy as np
import paho.mqtt.client as paho


class Line:
    """A line to the server that can be cut."""

    def __init__(self, port: int) -> None:
        self._to, self._cut = port, False
        self._open: set[socket.socket] = set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                here, _ = self._listener.accept()
                if self._cut:
                    here.close()
                    continue
                try:
                    there = socket.create_connection(("127.0.0.1", self._to))
                except OSError:  # nobody is there
                    here.close()
                    continue
                self._open |= {here, there}
                for one, other in ((here, there), (there, here)):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    threading.Thread(target=self._pump, args=(one, other), daemon=True).start()

    def _pump(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while said := one.recv(1 << 16):
                other.sendall(said)
        for end in (one, other):
            self._open.discard(end)
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def cut(self, cut: bool) -> None:
        """Cuts it, whatever is on its way; or lets it carry again."""
        self._cut = cut
        for end in tuple(self._open) if cut else ():
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


class Machines:
    """What all twins' machines send, at a steady pace; and what the broker acknowledged."""

    def __init__(
        self, port: int, twins: list[str], rng: np.random.Generator, rate: float
    ) -> None:  # fmt: skip
        self._said: list[tuple[str, int, paho.MQTTMessageInfo]] = []
        self._twins, self._rng, self._rate, self._ends = twins, rng, rate, threading.Event()
        self._client = paho.Client(paho.CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
        self._client.max_inflight_messages_set(1000)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        self._thread = threading.Thread(target=self._speak, daemon=True)
        self._thread.start()

    def _speak(self) -> None:
        ways, second, began = dict.fromkeys(self._twins, 0.0), 0, time.monotonic()
        while not self._ends.is_set():
            speed = 5.0 + 15.0 * (second // 10 % 2)
            for twin in self._twins:
                x = ways[twin] + self._rng.normal(0.0, 0.2)
                text = json.dumps({"t": float(second), "v_cmd": speed, "x": round(x, 3)})
                self._said.append((twin, second, self._client.publish(twin, text, qos=1)))
                ways[twin] += 1.1 * speed
            second += 1
            self._ends.wait(max(began + second / self._rate - time.monotonic(), 0.0))

    def end(self) -> None:
        """Says no more; all that was said is acknowledged."""
        self._ends.set()
        self._thread.join()
        for _, _, one in self._said:
            one.wait_for_publish(10.0)
        self._client.loop_stop()

    @property
    def acknowledged(self) -> dict[str, list[int]]:
        """What the broker took of each twin's, in seconds of the machine."""
        found: dict[str, list[int]] = {twin: [] for twin in self._twins}
        for twin, second, one in self._said:
            if one.is_published():
                found[twin].append(second)
        return found
