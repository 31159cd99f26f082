"""``evertwin detect``: what a recording's images show, and labels for ``evertwin confusions``."""

from __future__ import annotations

import csv
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.app.console import Alive, show
from evertwin.errors import DataError
from evertwin.features.images.detector import DATA, Detection, Detector
from evertwin.features.images.labelled import NOTHING
from evertwin.features.images.marks import EDGES, Mark, average_precision, judged, read_marks
from evertwin.report.image_picture import Sheet
from evertwin.sources.recording import open_recording
from evertwin.sources.robot_logs.images import BagImage, Images, images_of

LEAST = 0.02
"""Probability from which a detection counts in the average precision, which has no threshold."""
NEAR = 10**6
"""A row of the table is of an image whose stamp is that close [ns]: tables round large numbers."""


def show_detections(
    file: Path, out: Path, given: tuple[Path | None, Path | None], topic: str, least: float,
    as_json: bool,
) -> None:  # fmt: skip
    """``evertwin detect``; ``given``: the table of what the images show, the net.

    Raises:
        DataError: the recording has no image that can be read, or the table is of none of them.
    """
    objects, weights = given
    marks = None if objects is None else read_marks(objects)
    run = _Run(Detector(weights or DATA), least, marks)
    with Alive() as alive:
        alive.say("looking at the images")
        for image in images_of(open_recording(file), topic):
            run.take(image)
    if not run.seconds:
        why = "" if run.images is None else f": {'; '.join(run.images.findings)}"
        raise DataError(f"{file}: expected images that can be read, got none{why}")
    if marks and not run.met:
        raise DataError(f"{objects}: t_ns: none is the stamp of an image, from {run.span}")
    out.mkdir(parents=True, exist_ok=True)
    run.write(out)
    show(run.content(), run.text(out), as_json)


class _Run:
    """A detector on the images of one topic."""

    def __init__(self, detector: Detector, least: float, marks: list[Mark] | None) -> None:
        self.detector, self.least, self.marks = detector, least, marks
        self.images: Images | None = None
        self.seconds: list[float] = []
        self.met = 0
        """Images that the table has rows of."""
        self._stamps = np.array([one.t for one in marks or ()], dtype=np.int64)
        self._settings = tuple(marks[0].settings) if marks else ()
        self._said: list[tuple[int, Detection]] = []
        self._known: list[tuple[Sequence[Mark], list[Detection]]] = []
        self._labels: list[tuple[object, ...]] = []
        self._sheet = Sheet()

    @property
    def span(self) -> str:
        """First and last stamp of the images."""
        assert self.images is not None
        return f"{min(self.images.t)} to {max(self.images.t)}"

    def take(self, image: Any) -> None:
        """One more image, of the first topic that has one."""
        self.images = self.images or Images(image.topic)
        if image.topic != self.images.name:
            return
        self.images.add(image)
        if not isinstance(image, BagImage):
            return
        start = time.perf_counter()
        every = self.detector.detect(image.pixels, LEAST)
        self.seconds.append(time.perf_counter() - start)
        seen = [one for one in every if one.probability >= self.least]
        self._said += [(image.t, one) for one in seen]
        mine = self._of(image.t)
        self.met += bool(mine)
        if self.marks is not None:
            self._known.append((mine, every))
            self._judge(image.t, mine, seen)
        self._sheet.add(image, [(one.label, one.corners) for one in seen],
                        [one.corners for one in mine if one.label])  # fmt: skip

    def _of(self, t: int) -> list[Mark]:
        low, high = np.searchsorted(self._stamps, [t - NEAR, t + NEAR + 1])
        return (self.marks or [])[low:high]

    def _judge(self, t: int, mine: list[Mark], seen: list[Detection]) -> None:
        """Rows of labels; a false alarm hangs together with the image's things if these do."""
        groups = {one.group for one in mine} - {""}
        alone = groups.pop() if len(groups) == 1 else f"image {t}"
        for one in judged(mine, seen):
            group = one.mark.group if one.mark is not None else ""
            settings = one.mark.settings if one.mark is not None else {}
            numbers = (settings.get(name, float("nan")) for name in self._settings)
            cells = ("" if np.isnan(value) else f"{value:.9g}"
                     for value in (one.probability, *numbers))  # fmt: skip
            words = ("" if word == NOTHING else word for word in (one.truth, one.label))
            self._labels.append((*words, next(cells), group or alone, *cells))

    def write(self, out: Path) -> None:
        """``detections.csv``, ``labels.csv`` where it is known what the images show, a picture."""
        lines = [f"t_ns,label,probability,{','.join(EDGES)}"]
        lines += [
            f"{t},{one.label},{one.probability:.4f},{','.join(f'{c:.1f}' for c in one.corners)}"
            for t, one in self._said
        ]
        (out / "detections.csv").write_text("\n".join([*lines, ""]), encoding="utf-8")
        if self.marks is not None:
            head = ("truth", "label", "probability", "group", *self._settings)
            with (out / "labels.csv").open("w", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([head, *self._labels])
        self._sheet.save(out / "detections.png")

    def precision(self) -> dict[str, float]:
        """Average precision of each class that the images show."""
        labels = sorted({one.label for one in self.marks or () if one.label})
        return {label: average_precision(self._known, label) for label in labels}

    def content(self) -> dict[str, Any]:
        """As JSON."""
        assert self.images is not None
        return {
            "schema": "evertwin.detections/1", "images": len(self.seconds),
            "topic": self.images.name, "lost": len(self.images.lost),
            "findings": list(self.images.findings),
            "ms_an_image": 1e3 * float(np.median(self.seconds)), "least": self.least,
            "detections": dict(Counter(one.label for _, one in self._said)),
            "judged_images": self.met, "average_precision": self.precision() or None,
        }  # fmt: skip

    def text(self, out: Path) -> str:
        """For a terminal."""
        told = self.content()
        counts = ", ".join(f"{n} {label}" for label, n in sorted(told["detections"].items()))
        lines = [
            f"{told['topic']}: {told['images']} images, {told['ms_an_image']:.1f} ms each: "
            f"{counts or 'nothing'} (probability {self.least:g} or more)",
            *(f"  {line}" for line in told["findings"]),
        ]
        if told["average_precision"]:
            each = told["average_precision"].items()
            mean = float(np.mean([value for _, value in each]))
            classes = ", ".join(f"{label} {value:.2f}" for label, value in each)
            lines.append(f"  average precision (overlap by half): {mean:.2f} ({classes})")
        files = "detections.csv, detections.png" + (", labels.csv" if self.marks else "")
        return "\n".join([*lines, f"{out}: {files}"])
