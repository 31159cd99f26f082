"""What the robot says, as a bag: the messages that it has in ROS, in MCAP as JSON.

>>> import tempfile
>>> file = Path(tempfile.mkdtemp()) / "run.mcap"
>>> save_bag(file, [Sample("imu", 0.5, 5, {"gyro": 0.1})], start=0.0)
>>> file.read_bytes()[1:5]
b'MCAP'
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evertwin.sources.foreign import load
from evertwin.worlds.live.contract import Sample
from evertwin.worlds.live.voices.ros import TYPES, mounted, said, stamp, transform

CAMERA = "/camera/image_raw/compressed"


_KINDS = {**TYPES, CAMERA: "sensor_msgs/CompressedImage"}


def save_bag(path: Path, samples: Iterable[Sample], start: float) -> None:
    """Writes what the robot said; ``start``: of its clock, seconds since 1970."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        writer = load("mcap.writer").Writer(file)
        writer.start(profile="ros1", library="evertwin")
        channels: dict[str, int] = {}

        def put(topic: str, t: float, content: dict[str, Any]) -> None:
            if topic not in channels:
                kind = _KINDS["/tf" if topic == "/tf_static" else topic]
                schema = writer.register_schema(kind, "jsonschema", b'{"type": "object"}')
                channels[topic] = writer.register_channel(topic, "json", schema)
            data = json.dumps(_finite(content), allow_nan=False).encode()
            writer.add_message(channels[topic], round(t * 1e9), data, round(t * 1e9))

        put("/tf_static", start, mounted())
        for one in samples:
            if any(isinstance(v, float) and math.isnan(v) for v in one.values.values()):
                continue  # it is not said
            t = start + one.t
            topic, content = (_image if one.topic == "camera" else said)(one.topic, t, one.values)
            put(topic, t, content)
            if one.topic == "odom":
                put("/tf", t, transform(t, one.values))
        writer.finish()


def _image(_: str, t: float, values: Any) -> tuple[str, dict[str, Any]]:
    data = base64.b64encode(values["image"]).decode()
    header = {"stamp": stamp(t), "frame_id": "camera"}
    return CAMERA, {"header": header, "format": "png", "data": data}


def _finite(content: Any) -> Any:
    """With null for what JSON has no number for."""
    if isinstance(content, dict):
        return {name: _finite(value) for name, value in content.items()}
    if isinstance(content, list):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
