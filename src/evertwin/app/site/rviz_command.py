"""What ``evertwin ros rviz`` does: the configuration of RViz, and the lines that start it."""

from __future__ import annotations

import asyncio
import shlex
from pathlib import Path

from evertwin.app.console import show
from evertwin.errors import DataError, UsageError
from evertwin.publishers.ros_spec import RosOutSettings
from evertwin.ros.node import NodeDown
from evertwin.ros.rviz import Look, config, drawn
from evertwin.ros.topics import topics_of
from evertwin.service.site.site_plan import read_site


def write_rviz(site: Path, out: Path | None, as_json: bool) -> None:
    """Writes the file; shows what it draws, and how it is started.

    Raises:
        UsageError: no twin of the site speaks ROS.
        DataError: the master does not answer, or nothing there can be drawn.
    """
    settings = [
        one for plan in read_site(site).twins for one in plan.publishers
        if isinstance(one, RosOutSettings)
    ]  # fmt: skip
    if not settings:
        raise UsageError(f'{site}: no [[twin.publisher]] with protocol = "ros": give a twin one')
    first = settings[0]
    try:
        topics = asyncio.run(topics_of(first.place))
    except NodeDown as error:
        raise DataError(f"{error}: start it, the robot and evertwin serve first") from None
    seen = drawn(topics)
    if not seen:
        raise DataError(f"nothing that RViz draws is published at {first.master}")
    out = site.with_suffix(".rviz") if out is None else out
    out.write_text(config(topics, Look(first.map, first.base, first.topic)), encoding="utf-8")
    start = f"ROS_MASTER_URI={first.master} rviz -d {shlex.quote(str(out))}"
    hidden = f"ROS_MASTER_URI={first.master} xvfb-run rviz -d {shlex.quote(str(out))}"
    silent = not any(topic.startswith(f"{first.topic}/") for topic in seen)
    note = f"\nno twin speaks below {first.topic} yet: start evertwin serve {site}" * silent
    text = f"{out}: {', '.join(seen)}{note}\n{start}"
    show({"schema": "evertwin.rviz/1", "file": str(out), "topics": seen, "start": start,
          "without_display": hidden}, text, as_json)  # fmt: skip
