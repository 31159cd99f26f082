"""Some images of a recording on one sheet, with what is seen in them.

>>> import numpy as np
>>> sheet = Sheet(most=2)
>>> for t in range(5):
...     sheet.add(BagImage("/camera", t, np.zeros((4, 6, 3), np.uint8)))
>>> [image.t for image, _, _ in sheet.kept]
[0, 2, 4]
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from evertwin.sources.robot_logs.images import BagImage

Corners = tuple[float, float, float, float]
SEEN, KNOWN = "#D55E00", "#009E73"


class Sheet:
    """Fewer than twice ``most`` of all images, evenly chosen. See the module for an example."""

    def __init__(self, most: int = 6) -> None:
        self.kept: list[tuple[BagImage, Sequence[tuple[str, Corners]], Sequence[Corners]]] = []
        self._most, self._step, self._count = most, 1, 0

    def add(
        self, image: BagImage, seen: Sequence[tuple[str, Corners]] = (),
        known: Sequence[Corners] = (),
    ) -> None:  # fmt: skip
        """One more image: what is said to be seen, and what is known to be there [pixels]."""
        if self._count % self._step == 0:
            self.kept.append((image, seen, known))
        self._count += 1
        if len(self.kept) == 2 * self._most:
            self.kept, self._step = self.kept[::2], 2 * self._step

    def save(self, file: Path) -> None:
        """Writes them, three in a row."""
        rows = -(-len(self.kept) // 3)
        figure = Figure(figsize=(12.0, 3.2 * rows), layout="constrained")
        for k, (image, seen, known) in enumerate(self.kept):
            axes = figure.add_subplot(rows, 3, k + 1)
            axes.imshow(image.pixels)
            for colour, boxes in ((KNOWN, [("", one) for one in known]), (SEEN, seen)):
                for label, (left, upper, right, lower) in boxes:
                    size = right - left, lower - upper
                    axes.add_patch(Rectangle((left - 0.5, upper - 0.5), *size, fill=False,
                                             edgecolor=colour, lw=1.2))  # fmt: skip
                    axes.text(left, upper, label, color=colour, fontsize=7, va="bottom")
            axes.set_axis_off()
            axes.set_title(f"{image.topic} {image.t * 1e-9:.3f} s", fontsize=7)
        figure.savefig(file, dpi=110)
