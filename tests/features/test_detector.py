"""The detector: what its cells say, how it is judged, and that it finds things it never saw."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.errors import DataError, UsageError
from evertwin.features.images.detector import DATA, Detection, Detector, decoded
from evertwin.features.images.labelled import NOTHING, read_labelled
from evertwin.features.images.marks import Mark, average_precision, judged, read_marks
from evertwin.sources import open_recording
from evertwin.sources.robot_logs.images import BagImage, images_of

CLASSES = ("box", "table")


def test_neighbours_and_overlapping_boxes_say_it_once() -> None:
    cells = np.zeros((4, 6, 2, 5))
    cells[1, 1, 0] = 0.9, 0, 0, 10, 10
    cells[1, 2, 0] = 0.8, 0, 0, 10, 10  # a neighbour
    cells[1, 4, 0] = 0.7, 1, 0, 11, 10  # no neighbour, but the same box
    cells[1, 1, 1] = 0.6, 0, 0, 10, 10  # of another class
    cells[3, 5, 0] = 0.5, 40, 40, 50, 50
    found = decoded(cells, CLASSES, 0.3)
    assert [(one.label, one.probability) for one in found] == [("box", 0.9), ("table", 0.6),
                                                              ("box", 0.5)]  # fmt: skip
    assert len(decoded(cells, CLASSES, 0.55)) == 2


def box(label: str, left: float, probability: float = 0.9) -> Detection:
    return Detection(label, probability, (left, 0.0, left + 10.0, 10.0))


def mark(label: str, left: float) -> Mark:
    return Mark(0, label, (left, 0.0, left + 10.0, 10.0))


def test_things_and_detections_are_paired_once_own_class_first() -> None:
    marks = [mark("box", 0), mark("table", 1), mark("table", 40), mark("", 60)]
    seen = [box("table", 0), box("box", 2, 0.4), box("box", 61), box("box", 90)]
    rows = judged(marks, seen)
    assert [(one.truth, one.label) for one in rows] == [
        ("box", "box"), ("table", "table"), ("table", NOTHING), (NOTHING, "box")]  # fmt: skip
    assert rows[0].probability == 0.4 and math.isnan(rows[2].probability)


def test_average_precision_by_hand() -> None:
    # by falling probability: right, wrong, right; one of three is never found
    images = [
        ([mark("box", 0), mark("box", 30)], [box("box", 1, 0.9), box("box", 60, 0.8)]),
        ([mark("box", 0), mark("table", 40)], [box("box", 0, 0.7), box("table", 41, 0.1)]),
    ]
    assert average_precision(images, "box") == pytest.approx((1 + 2 / 3) / 3)
    assert average_precision(images, "table") == 1.0
    assert math.isnan(average_precision(images, "person"))
    twice = [([mark("box", 0)], [box("box", 0, 0.9), box("box", 1, 0.8)])]
    assert average_precision(twice, "box") == 1.0, "the second is wrong, but comes later"
    assert average_precision([([mark("", 0)], [box("box", 0)]), *twice], "box") == 1.0


@pytest.fixture(scope="module")
def halls(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of pictures of halls that no net was trained on."""
    bag = tmp_path_factory.mktemp("camera") / "halls.mcap"
    with pytest.raises(SystemExit) as ended:
        main(["camera", "--images", "60", "--seed", "77", "-o", str(bag)])
    assert not ended.value.code
    return bag


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


def test_it_finds_things_in_halls_it_never_saw(
    halls: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    objects = halls.with_name("halls-objects.csv")
    assert not run("detect", halls, "--objects", objects, "-o", tmp_path, "--json")
    told = json.loads(capsys.readouterr().out)
    assert (told["images"], told["lost"]) == (60, 0) and told["ms_an_image"] < 500
    assert np.mean(list(told["average_precision"].values())) > 0.7
    assert set(told["average_precision"]) == {"box", "person", "table"}
    asked = [one for one in read_marks(objects) if one.label]
    rows = (tmp_path / "labels.csv").read_text().splitlines()
    assert rows[0] == "truth,label,probability,group,distance,light,pixels"
    assert sum(not row.startswith(",") for row in rows[1:]) == len(asked)
    assert (tmp_path / "detections.png").stat().st_size > 10_000
    assert len((tmp_path / "detections.csv").read_text().splitlines()) > 50


def test_simulated_and_real_labels_go_into_confusions(
    halls: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    real = tmp_path / "run.mcap"
    assert not run("machine", "robot", "--record", real, "--seconds", 40, "--camera", 0.5,
                   "--order", "0:people=3")  # fmt: skip
    for bag, name in ((halls, "simulated"), (real, "real")):
        objects = bag.with_name(f"{bag.stem}-objects.csv")
        assert not run("detect", bag, "--objects", objects, "-o", tmp_path / name)
    capsys.readouterr()
    files = [tmp_path / name / "labels.csv" for name in ("simulated", "real")]
    assert not run("confusions", *files, "--json")
    told = json.loads(capsys.readouterr().out)
    assert told["groups"]["simulated"] > 30 and told["groups"]["real"] > 1
    assert {one["setting"] for one in told["coverage"]} == {"distance", "light", "pixels"}
    assert {"box", "person", "table", NOTHING} == set(read_labelled(files).classes)


def test_an_image_of_another_size_gives_the_same_boxes_in_its_own_pixels(halls: Path) -> None:
    detector = Detector()
    one = next(
        image for image in images_of(open_recording(halls))
        if isinstance(image, BagImage) and detector.detect(image.pixels, 0.5)
    )  # fmt: skip
    small = detector.detect(one.pixels, 0.5)
    large = detector.detect(np.kron(one.pixels, np.ones((4, 4, 1), np.uint8)), 0.5)
    assert [x.label for x in small] == [x.label for x in large]
    for a, b in zip(small, large, strict=True):
        np.testing.assert_allclose(4 * np.array(a.corners), b.corners, atol=8)
    wide = np.concatenate([one.pixels, one.pixels[:, ::-1]], axis=1)
    for found in detector.detect(wide):
        left, upper, right, lower = found.corners
        assert 0 <= left < right <= 256 and 0 <= upper < lower <= 96


def test_the_weights_are_small_and_say_what_they_know() -> None:
    assert DATA.stat().st_size < 2_000_000
    assert Detector().classes == ("box", "person", "table")


def test_what_is_no_net_or_no_table_is_an_error(halls: Path, tmp_path: Path) -> None:
    (tmp_path / "net.onnx").write_bytes(b"not a net")
    with pytest.raises(UsageError, match=r"net\.onnx: expected a net in ONNX"):
        Detector(tmp_path / "net.onnx")
    table = tmp_path / "objects.csv"
    table.write_text("t_ns,label,left,upper,right,lower\n5000,box,1,1,1,9\n")
    with pytest.raises(DataError, match=r"objects\.csv:2: expected left < right"):
        read_marks(table)
    table.write_text("t_ns,label,left,upper,right,lower\n5000,7,1,1,3,9\n")
    with pytest.raises(DataError, match="no words in 'label'"):
        read_marks(table)
    table.write_text("t_ns,label,left,upper,right,lower\n500000000,box,1,1,3,9\n")
    assert run("detect", halls, "--objects", table, "-o", tmp_path) == 4
    (tmp_path / "run.csv").write_text("t,x\n0,1\n1,2\n")
    assert run("detect", tmp_path / "run.csv", "-o", tmp_path) == 4
    assert run("camera", "-o", tmp_path / "x.bag") == 2
    assert run("camera", tmp_path / "room.xml", "-o", tmp_path / "x.mcap") == 2
    assert run("machine", "robot", "--camera", 1) == 2
