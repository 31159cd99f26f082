"""The configuration of RViz: a display for each topic of a master that it can draw.

RViz reads YAML, and JSON is YAML.

>>> import json
>>> one = config({"/scan": "sensor_msgs/LaserScan"}, Look("map", "base_link", "/evertwin"))
>>> [one["Name"] for one in json.loads(one)["Visualization Manager"]["Displays"]]
['Grid', 'TF', '/scan']
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

Display = dict[str, Any]
TWIN, MACHINE = "70; 150; 255", "90; 220; 110"
"""Colours of what is simulated and of what is measured."""
WHEELS, BEAMS = "240; 190; 60", "255; 90; 50"
WIDE, HIGH = 1280, 800
"""Size of the window."""


class Look(NamedTuple):
    """From where the picture is drawn.

    >>> Look("map", "base_link", "/evertwin").fixed
    'map'
    """

    fixed: str
    """Frame in which all is drawn."""
    base: str
    """Frame that is kept in the middle; where it is not known, the view stays where it is."""
    topic: str
    """What the topics of twins begin with."""


def config(topics: Mapping[str, str], look: Look) -> str:
    """The text of a ``.rviz`` file. ``topics``: each with its type."""
    shown = [_grid(look), _frames()]
    for topic, kind in topics.items():
        make = _KINDS.get(kind)
        if make is not None:
            twin = topic.startswith(f"{look.topic}/")
            shown.append({**make(topic, twin), "Name": topic[len(look.topic) * twin :]})
    view = {
        "Class": "rviz/Orbit", "Name": "Current View", "Target Frame": look.base,
        "Distance": 11.0, "Pitch": 0.95, "Yaw": 4.2, "Focal Point": {"X": 0, "Y": 0, "Z": 0},
    }  # fmt: skip
    text = {
        "Panels": [
            {"Class": "rviz/Displays", "Name": "Displays",
             "Property Tree Widget": {"Expanded": [], "Splitter Ratio": 0.7}},
        ],
        "Visualization Manager": {
            "Class": "",
            "Displays": shown,
            "Enabled": True,
            "Global Options": {"Background Color": "32; 34; 40", "Fixed Frame": look.fixed,
                               "Frame Rate": 30},
            "Name": "root",
            "Tools": [{"Class": "rviz/MoveCamera"}, {"Class": "rviz/Measure"}],
            "Value": True,
            "Views": {"Current": view, "Saved": []},
        },
        "Window Geometry": {"Height": HIGH, "Width": WIDE, "X": 0, "Y": 0,
                            "Displays": {"collapsed": False}, "Hide Right Dock": True},
    }  # fmt: skip
    return json.dumps(text, indent=1) + "\n"


def drawn(topics: Mapping[str, str]) -> list[str]:
    """Those of the topics that it shows."""
    return [topic for topic, kind in topics.items() if kind in _KINDS]


def _display(kind: str, **settings: Any) -> Display:
    return {"Class": f"rviz/{kind}", "Name": kind, "Enabled": True, "Value": True, **settings}


def _grid(look: Look) -> Display:
    more = {"Color": "90; 90; 96", "Cell Size": 1, "Plane Cell Count": 12}
    return _display("Grid", **more, **{"Reference Frame": look.fixed})


def _frames() -> Display:
    return _display("TF", **{"Marker Scale": 1.5, "Show Arrows": True, "Show Axes": True,
                                   "Show Names": True, "Frame Timeout": 15})  # fmt: skip


def _scan(topic: str, _: bool) -> Display:
    return _display("LaserScan", Topic=topic, **{
        "Color Transformer": "FlatColor", "Color": BEAMS, "Position Transformer": "XYZ",
        "Style": "Spheres", "Size (m)": 0.06, "Decay Time": 0, "Queue Size": 20,
        "Use Fixed Frame": True, "Selectable": False,
    })  # fmt: skip


def _odometry(topic: str, twin: bool) -> Display:
    """The simulated pose with its variance; what the wheels say as a trace."""
    wide = 0.02 if twin else 0.035
    shape = {"Value": "Arrow", "Alpha": 0.9, "Color": TWIN if twin else WHEELS,
             "Shaft Length": 0.25, "Shaft Radius": wide, "Head Length": 5 * wide,
             "Head Radius": 2.5 * wide}  # fmt: skip
    spread = {"Value": twin, "Orientation": {"Value": False},
              "Position": {"Value": twin, "Alpha": 0.3, "Color": TWIN, "Scale": 3}}  # fmt: skip
    return _display("Odometry", Topic=topic, Shape=shape, Covariance=spread, **{
        "Keep": 1 if twin else 60, "Position Tolerance": 0.0 if twin else 0.4,
        "Angle Tolerance": 0.0 if twin else 0.5, "Queue Size": 20,
    })  # fmt: skip


def _path(topic: str, twin: bool) -> Display:
    simulated = twin and topic.endswith("/path")
    return _display("Path", Topic=topic, **{
        "Color": TWIN if simulated else MACHINE, "Line Style": "Billboards",
        "Line Width": 0.03 if simulated else 0.06, "Alpha": 1.0 if simulated else 0.6,
        "Offset": {"X": 0, "Y": 0, "Z": 0.02 if simulated else 0},
    })  # fmt: skip


def _markers(topic: str, _: bool) -> Display:
    return _display("MarkerArray", **{"Marker Topic": topic, "Queue Size": 50})


def _map(topic: str, _: bool) -> Display:
    return _display("Map", Topic=topic, Alpha=0.6)


_KINDS = {
    "sensor_msgs/LaserScan": _scan,
    "nav_msgs/Odometry": _odometry,
    "nav_msgs/Path": _path,
    "visualization_msgs/MarkerArray": _markers,
    "nav_msgs/OccupancyGrid": _map,
}
