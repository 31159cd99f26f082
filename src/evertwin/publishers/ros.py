"""What a twin says, at a ROS 1 master: by a node in a process of its own, which may die.

``/evertwin/NAME/prediction`` is the predicted pose of a base (``nav_msgs/Odometry``) or the joints
of an arm (``sensor_msgs/JointState``, effort as predicted); ``path``, ``measured`` and ``markers``
show a base in RViz; ``/diagnostics`` has health, residuals and lives of every twin. Where the site
file names the frame of the machine's odometry, ``/tf`` places it in the map. The node has no way to
say anything else: no command, no goal, no parameter.
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evertwin.backoff import Backoff
from evertwin.publishers import ros_content as content
from evertwin.publishers.contract import About, Ask, News
from evertwin.publishers.lasting import lasting
from evertwin.publishers.ros_base import Base, Placing
from evertwin.publishers.ros_maps import MAPS, Maps
from evertwin.publishers.ros_spec import RosOutSettings
from evertwin.ros.node import Node, NodeDown, Subscription, node_at
from evertwin.ros.transforms import TYPES, transforms

LOG = logging.getLogger("evertwin.live")
FORCES = ("N", "Nm")
CONTESTED = 4
"""`Mark` from which a measurement is doubted."""


class RosOut:
    """Implements `Publisher`.

    >>> RosOut.__name__
    'RosOut'
    """

    def __init__(self, settings: RosOutSettings, about: About, ask: Ask) -> None:
        self.settings, self._about = settings, about
        self._topic = f"{settings.topic}/{re.sub(r'[^A-Za-z0-9_]', '_', about.name)}"
        scene = about.scene
        moves = scene["kind"] in ("base", "line")
        self._base = Base(scene["pose"], settings.size) if moves else None
        self._placing = Placing(settings.odom, settings.base) if moves and settings.odom else None
        self._maps = Maps(Path(settings.maps), settings.map) if settings.maps else None
        self._counts: Counter[str] = Counter()
        self._state, self._reason = "connecting", ""
        self._node: Node | None = None
        self._task: asyncio.Task[None] | None = None
        self._newest: Mapping[str, Any] | None = None
        self._lives: Mapping[str, Any] = {"components": {}, "alarms": ()}
        self._event = ""

    @property
    def health(self) -> Mapping[str, Any]:
        """See `Publisher`."""
        reason = self._reason
        if self._state == "up" and self._node is not None:
            parts = (self._placing, self._maps)
            told = [self._node.refused, *(part.reason for part in parts if part is not None)]
            reason = next(filter(None, told), "")
        return {"protocol": "ros", "state": self._state, "reason": reason} | dict(self._counts)

    def open(self) -> None:
        """See `Publisher`."""
        self._task = asyncio.create_task(self._run())

    def publish(self, news: News) -> None:
        """See `Publisher`."""
        if news.kind == "rows":
            self._rows(news.content)
        elif news.kind == "events":
            newest = news.content["events"][-1]
            self._event = f"{newest['kind']}: {newest['reason']}"
        elif news.kind == "health":
            self._health(news.content)
        elif news.kind == "life":
            self._lives = news.content

    async def close(self) -> None:
        """See `Publisher`."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        self._state = "closed"

    # ------------------------------------------------------------------ the node

    async def _run(self) -> None:
        """A node, and when it is gone another one."""
        wait = Backoff()
        while True:
            try:
                async with node_at(self.settings.place) as node:
                    self._advertise(node)
                    self._node, self._state, self._reason = node, "up", ""
                    LOG.info("%s: ros: up", self._topic)
                    wait.reset()
                    await self._listen(node)
                    self._down(await asyncio.shield(node.ended))
            except (NodeDown, OSError, TimeoutError) as error:
                self._down(str(error) or type(error).__name__)
            finally:
                self._node = None
            await asyncio.sleep(wait.next())

    def _down(self, reason: str) -> None:
        if self._state != "down":
            LOG.warning("%s: ros: down: %s", self._topic, reason)
        self._state, self._reason = "down", reason

    def _advertise(self, node: Node) -> None:
        kind, topic = self._about.scene["kind"], self._topic
        node.advertise(self.settings.diagnostics, "diagnostic_msgs/DiagnosticArray")
        if self._base is not None:
            node.advertise(f"{topic}/prediction", "nav_msgs/Odometry")
            node.advertise(f"{topic}/markers", "visualization_msgs/MarkerArray")
            for name in ("path", "measured"):
                node.advertise(f"{topic}/{name}", "nav_msgs/Path", latch=True)
        elif kind == "arm":
            node.advertise(f"{topic}/prediction", "sensor_msgs/JointState")
        if self._placing is not None:
            node.advertise("/tf", TYPES[0])
        if self._maps is not None:
            self._maps.again()
            for name, message in MAPS.items():
                node.advertise(f"{topic}/{name}", message, latch=True)

    async def _listen(self, node: Node) -> None:
        """What the machine's odometry and other localisations say, until the node is gone."""
        if self._placing is None:
            return
        lines = [node.subscribe(topic) for topic in ("/tf", "/tf_static")]
        try:
            await asyncio.gather(*(self._frames(self._placing, node, line) for line in lines))
        finally:
            for line in lines:
                node.leave(line)

    async def _frames(self, placing: Placing, node: Node, line: Subscription) -> None:
        while True:
            raw = await line.next()
            try:
                found = transforms(raw.data) if raw.type in TYPES else []
            except ValueError:
                self._counts["refused"] += 1
                continue
            for one in found:
                placing.heard(one, own=raw.publisher == node.known)
            if placing.due is not None and placing.odom is not None:
                odom = placing.frames[0]
                told = content.placed(self.settings.map, odom, placing.due, placing.odom)
                self._say("/tf", told)
                placing.due = None

    def _say(self, topic: str, message: content.Content) -> None:
        if self._node is None:
            self._counts["dropped"] += 1
        else:
            self._node.publish(topic, message)
            self._counts["sent"] += 1

    # ------------------------------------------------------------------ rows

    def _rows(self, rows: Mapping[str, Any]) -> None:
        self._newest = rows
        if self._base is not None:
            self._moved(self._base, rows)
        elif self._about.scene["kind"] == "arm":
            for k, t in enumerate(rows["t"]):
                self._joints(k, t, rows)

    def _moved(self, base: Base, rows: Mapping[str, Any]) -> None:
        step = None
        for step in base.steps(rows):
            head = content.header(step.t, self.settings.map)
            child = f"{self._about.name}/{self.settings.base}"
            told = content.odometry(head, child, step.before, step.speed, step.sigma)
            self._say(f"{self._topic}/prediction", told)
            if self._placing is not None:
                self._placing.anchor(step.t, step.after, update=step.moved)
        if step is not None:
            told = content.ghost(head, step.after, self.settings.size)
            self._say(f"{self._topic}/markers", told)

    def _joints(self, k: int, t: int, rows: Mapping[str, Any]) -> None:
        parts = self._about.scene["joints"]
        values: dict[str, list[float]] = {}
        if not self._about.scene["motors"]:
            for key, name in (("position", "input"), ("velocity", "speed")):
                values[key] = [rows["inputs"][part[name]][k] for part in parts]
        units = dict(self._about.outputs)
        if all(units[part["output"]] in FORCES for part in parts):
            values["effort"] = [rows["outputs"][part["output"]]["predicted"][k] for part in parts]
        whole = {key: v for key, v in values.items() if None not in v}
        head, names = content.header(t, ""), [part["name"] for part in parts]
        self._say(f"{self._topic}/prediction", content.joints(head, names, whole))

    # ------------------------------------------------------------------ once a second

    def _health(self, health: Mapping[str, Any]) -> None:
        rows = self._newest
        t = rows["t"][-1] if rows is not None else time.time_ns()
        told = [self._condition(health)]
        told += [] if rows is None else [
            self._residual(name, unit, rows["outputs"][name]) for name, unit in self._about.outputs
        ]  # fmt: skip
        told += [self._life(name, one) for name, one in self._lives["components"].items()]
        self._say(self.settings.diagnostics, {"header": content.header(t, ""), "status": told})
        if self._maps is not None and self._node is not None:
            for name, message in self._maps.changed(t):
                self._say(f"{self._topic}/{name}", message)
        if self._base is None or not self._base.way:
            return
        head = content.header(t, self.settings.map)
        self._say(f"{self._topic}/path", content.path(head, self._base.way))
        self._say(f"{self._topic}/measured", content.path(head, self._base.measured))
        marks = content.updates(head, self._base.jumps, self.settings.size)
        self._say(f"{self._topic}/markers", marks)

    def _condition(self, health: Mapping[str, Any]) -> content.Content:
        level = content.LEVELS.get(health["condition"], content.WARN)
        if health["stale"] and level == content.WARN:
            level = content.STALE
        told = {
            "state": health["state"], "age [s]": health["age"], "rows": health["rows"],
            "live version": health["champion"], "versions": health["versions"],
            "newest event": self._event or "none", "what came of it": health["headline"],
        }  # fmt: skip
        message = ": ".join(filter(None, (health["condition"], health["why"])))
        return content.status(f"evertwin/{self._about.name}", level, message, told)

    def _life(self, component: str, one: Mapping[str, Any]) -> content.Content:
        """How long it lasts; a warning while an alarm is due."""
        out = any(alarm["component"] == component for alarm in self._lives["alarms"])
        unit = one["life"].get("unit", "not known")
        told: dict[str, object] = {
            f"{name} [{unit}]": None if math.isnan(value) else value
            for name, value in lasting(one["life"]).items()
        }
        told |= {f"{one['indicator']} [{one['unit']}]": one["value"], "limit": one["limit"]}
        name = f"evertwin/{self._about.name}: life of {component}"
        level = content.WARN if out else content.OK
        return content.status(name, level, str(one["sentence"]), told)

    def _residual(self, name: str, unit: str, cells: Mapping[str, Any]) -> content.Content:
        """Of the newest row that has one."""
        known = [k for k, value in enumerate(cells["residual"]) if value is not None]
        k = known[-1] if known else -1
        off, doubted = cells["residual"][k], cells["mark"][k] >= CONTESTED
        message = "not measured" if off is None else f"off by {off:.4g} {unit}"
        told = {f"{key} [{unit}]": cells[key][k]
                for key in ("measured", "predicted", "residual", "sigma")}  # fmt: skip
        level = content.WARN if doubted else content.OK
        return content.status(f"evertwin/{self._about.name}: {name}", level, message, told)
