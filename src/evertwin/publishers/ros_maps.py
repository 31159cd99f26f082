"""The folder of a map, as ROS messages: walls, costs, tables. Each is said when its file changes.

`evertwin map -o FOLDER` writes ``map.yaml``, `evertwin tables -o FOLDER` ``costs.yaml`` and
``tables.csv``. What is there is said; what is written anew, since a table was moved, is said again.

>>> import tempfile
>>> folder = Path(tempfile.mkdtemp())
>>> _ = (folder / "tables.csv").write_text("number,x,y,heading,length,width\\n1,2,0,0,1.2,0.8\\n")
>>> maps = Maps(folder, "map")
>>> [(name, len(told["markers"])) for name, told in maps.changed(0)]
[('tables', 3)]
>>> list(maps.changed(0))
[]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from evertwin.errors import DataError
from evertwin.features.maps.cost_map import UNSEEN, read_costs
from evertwin.features.maps.occupancy import OCCUPIED, UNKNOWN, Occupancy, read
from evertwin.publishers.ros_content import Content, header, pose
from evertwin.sources.texts.small_table import read_table

CUBE, TEXT, DELETE_ALL = 1, 9, 3
"""Kinds of markers, and what takes all away."""
WOOD = {"r": 0.8, "g": 0.55, "b": 0.25, "a": 0.7}
PLATE, THICK = 0.72, 0.04
"""Height and thickness of the plate that is drawn [m]."""
LARGEST = 4_000_000
"""Cells of the largest map that is said."""
MAPS = {
    "map": "nav_msgs/OccupancyGrid", "costs": "nav_msgs/OccupancyGrid",
    "tables": "visualization_msgs/MarkerArray",
}  # fmt: skip


class Maps:
    """What was said of a folder. See the module for an example."""

    def __init__(self, folder: Path, frame: str) -> None:
        self._folder, self._frame = folder, frame
        self._said: dict[str, int] = {}
        """When the file of each was written [ns]."""
        self.reason = ""
        """Why a file is not said; empty: nothing is wrong."""

    def again(self) -> None:
        """All of it is said anew."""
        self._said.clear()

    def changed(self, t: int) -> Iterator[tuple[str, Content]]:
        """Messages of the files that were written since, by name. ``t``: their stamp [ns]."""
        makers: dict[str, tuple[str, Callable[[Path, Content], Content]]] = {
            "map": ("map.yaml", _walls), "costs": ("costs.yaml", _costs),
            "tables": ("tables.csv", _tables),
        }  # fmt: skip
        for name, (file, make) in makers.items():
            path = self._folder / file
            if not path.exists():
                continue
            written = path.stat().st_mtime_ns
            if self._said.get(name) == written:
                continue
            self._said[name] = written  # what cannot be read is looked at when it is written anew
            try:
                message = make(path, header(t, self._frame))
            except DataError as error:
                self.reason = str(error)
                continue
            self.reason = ""
            yield name, message


def _walls(file: Path, head: Content) -> Content:
    drawn = read(file)
    occupied = np.where(drawn.cells == UNKNOWN, -1, np.where(drawn.cells == OCCUPIED, 100, 0))
    return _grid(drawn, occupied, head, file)


def _costs(file: Path, head: Content) -> Content:
    drawn = read_costs(file)
    return _grid(drawn, np.where(drawn.cells == UNSEEN, -1, drawn.cells.astype(int)), head, file)


def _grid(drawn: Occupancy, values: np.ndarray, head: Content, file: Path) -> Content:
    """``nav_msgs/OccupancyGrid``.

    Raises:
        DataError: it has too many cells.
    """
    if values.size > LARGEST:
        raise DataError(f"{file}: {values.size} cells, at most {LARGEST} are said")
    rows, columns = values.shape
    about = {
        "map_load_time": head["stamp"], "resolution": drawn.resolution, "width": columns,
        "height": rows, "origin": pose((*drawn.origin, 0.0)),
    }  # fmt: skip
    return {"header": head, "info": about, "data": values.reshape(-1).tolist()}


def _tables(file: Path, head: Content) -> Content:
    """``visualization_msgs/MarkerArray``: those before are taken away, each is a plate and its
    number.

    Raises:
        DataError: a column is absent.
    """
    table = read_table(file)
    names = ("number", "x", "y", "heading", "length", "width")
    markers: list[Content] = [{"header": head, "ns": "tables", "action": DELETE_ALL}]
    for number, x, y, heading, length, width in zip(*map(table.column, names), strict=True):
        body, above = pose((x, y, heading)), pose((x, y, heading))
        body["position"]["z"], above["position"]["z"] = PLATE - THICK / 2, PLATE + 0.2
        markers += [
            {"header": head, "ns": "tables", "id": int(number), "type": CUBE, "pose": body,
             "scale": {"x": length, "y": width, "z": THICK}, "color": WOOD},
            {"header": head, "ns": "numbers", "id": int(number), "type": TEXT, "pose": above,
             "scale": {"z": 0.2}, "color": {**WOOD, "a": 1.0}, "text": f"table {number:.0f}"},
        ]  # fmt: skip
    return {"markers": markers}
