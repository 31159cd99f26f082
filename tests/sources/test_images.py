"""Images of bags: every encoding alike, packed or not, and what is wrong with them."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from PIL import Image
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from evertwin.app.cli import main
from evertwin.errors import DataError, UsageError
from evertwin.sources import inspect, open_recording
from evertwin.sources.robot_logs.images import BagImage, LostImage, images_of, pixels_of

START, PERIOD = 1_614_859_007 * 10**9, 100_000_000
PIXELS = np.random.default_rng(1).integers(0, 256, (6, 8, 3)).astype(np.uint8)
ORDERS = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "mono8": [0], "bgra8": [2, 1, 0, 0]}


def packed(kind: str) -> bytes:
    file = io.BytesIO()
    Image.fromarray(PIXELS).save(file, kind)
    return file.getvalue()


def written(kind: str, path: Path, said: list[tuple[str, str, dict[str, Any]]]) -> Path:
    """A bag of one message each 0.1 s: topic, type, what it says."""
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    types = store.types
    plugin = {} if ros1 else {"version": 9, "storage_plugin": StoragePlugin[kind.upper()]}
    with (Writer1 if ros1 else Writer2)(path, **plugin) as writer:
        links: dict[str, Any] = {}
        for k, (topic, name, content) in enumerate(said):
            t = START + k * PERIOD
            time = types["builtin_interfaces/msg/Time"](sec=t // 10**9, nanosec=t % 10**9)
            seq = {"seq": 0} if ros1 else {}
            header = types["std_msgs/msg/Header"](stamp=time, frame_id="camera", **seq)
            full = f"sensor_msgs/msg/{name}"
            if topic not in links:
                links[topic] = writer.add_connection(topic, full, typestore=store)
            data = np.frombuffer(content.pop("data"), np.uint8)
            made = types[full](header=header, data=data, **content)
            pack = store.serialize_ros1 if ros1 else store.serialize_cdr
            writer.write(links[topic], t + 5, pack(made, full))
    return path


def plain(encoding: str, padding: int = 0, pixels: np.ndarray = PIXELS) -> dict[str, Any]:
    """What an `Image` says."""
    rows = pixels[:, :, ORDERS[encoding]].reshape(len(pixels), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    height, width = pixels.shape[:2]
    return {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0,
            "step": rows.shape[1], "data": rows.tobytes()}  # fmt: skip


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_images_of_every_kind_of_bag(kind: str, tmp_path: Path) -> None:
    said = [("/camera", "Image", plain(encoding, padding=3)) for encoding in ORDERS]
    found = list(images_of(open_recording(written(kind, tmp_path / "run.bag", said))))
    assert [one.t for one in found] == [START + k * PERIOD for k in range(len(ORDERS))]
    for one, encoding in zip(found, ORDERS, strict=True):
        assert isinstance(one, BagImage) and one.encoding == encoding
        grey = np.repeat(PIXELS[:, :, :1], 3, axis=2)
        np.testing.assert_array_equal(one.pixels, grey if encoding == "mono8" else PIXELS)


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_packed_images_alone_are_a_recording(kind: str, tmp_path: Path) -> None:
    said = [
        ("/camera/compressed", "CompressedImage", {"format": one.lower(), "data": packed(one)})
        for one in ("PNG", "JPEG", "PNG")
    ]
    path = written(kind, tmp_path / "run.bag", said)
    png, jpeg, _ = images_of(open_recording(path))
    assert isinstance(png, BagImage) and isinstance(jpeg, BagImage)
    np.testing.assert_array_equal(png.pixels, PIXELS)
    assert jpeg.pixels.shape == PIXELS.shape and jpeg.encoding == "jpeg"
    (info,) = inspect(path).images
    assert (info.name, info.count, info.lost) == ("/camera/compressed", 3, 0)
    assert info.rate == pytest.approx(10.0) and info.kinds == ((8, 6, "jpeg"), (8, 6, "png"))


def test_images_in_json_are_base64_or_numbers(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/CompressedImage", "jsonschema", b"{}")
        channel = writer.register_channel("/camera", "json", schema)
        png = packed("PNG")
        for k, data in enumerate([base64.b64encode(png).decode(), [*png], "no base64!"]):
            content = json.dumps({"format": "png", "data": data}).encode()
            writer.add_message(channel, k + 1, content, k + 1)
        writer.finish()
    first, second, third = images_of(open_recording(path))
    assert isinstance(first, BagImage) and isinstance(second, BagImage)
    np.testing.assert_array_equal(first.pixels, second.pixels)
    assert isinstance(third, LostImage)


def test_what_is_cut_off_is_counted_with_its_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short, depth = plain("rgb8"), plain("mono8") | {"encoding": "16UC1"}
    short["data"] = short["data"][:50]
    said = [("/raw", "Image", one) for one in (plain("rgb8"), short, depth, plain("bgr8"))]
    cut, bomb = packed("JPEG")[:-40], io.BytesIO()
    Image.new("1", (10_000, 10_000)).save(bomb, "PNG")
    said += [("/packed", "CompressedImage", {"format": "jpeg", "data": data})
             for data in (packed("JPEG"), cut, b"", bomb.getvalue())]  # fmt: skip
    path = written("mcap", tmp_path / "run.bag", said)
    found = list(images_of(open_recording(path)))
    assert [isinstance(one, LostImage) for one in found] == [0, 1, 1, 0, 0, 1, 1, 1]
    assert isinstance(found[1], LostImage) and "cut off" in found[1].reason
    assert isinstance(found[2], LostImage) and "16UC1" in found[2].reason
    assert isinstance(found[7], LostImage) and found[7].reason == "an image of 10000 × 10000"
    info = inspect(path)
    assert [(one.count, one.lost) for one in info.images] == [(4, 2), (4, 3)]
    assert "/raw: 2 of 4 images cannot be read: left out" in " ".join(info.findings)
    with pytest.raises(SystemExit):
        main(["info", str(path), "--picture", str(tmp_path / "sheet.png")])
    assert (
        "/raw: 4 images, 8 × 6 bgr8, 8 × 6 rgb8, 10 Hz, 2 cannot be read" in capsys.readouterr().out
    )
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.width > 300


def test_a_picture_of_no_images_and_an_absent_topic_are_errors(tmp_path: Path) -> None:
    path = written("mcap", tmp_path / "run.bag", [("/raw", "Image", plain("rgb8"))])
    with pytest.raises(UsageError, match="no images on '/rav': did you mean '/raw'"):
        list(images_of(open_recording(path), "/rav"))
    table = tmp_path / "run.csv"
    table.write_text("t,x\n0,1\n1,2\n")
    assert not list(images_of(open_recording(table)))
    from evertwin.app.first.info_command import show_info

    with pytest.raises(DataError, match="no image and no scan that can be read"):
        show_info(table, False, False, tmp_path / "sheet.png")


@pytest.mark.parametrize(
    "wrong",
    [{"width": 0}, {"width": "wide"}, {"height": 1 << 40}, {"height": 7}, {"data": [300] * 144},
     {"data": None}, {"encoding": 5}],
)  # fmt: skip
def test_an_image_that_states_nonsense_is_an_error_of_the_data(wrong: dict[str, Any]) -> None:
    content = plain("rgb8")
    assert pixels_of(content).shape == PIXELS.shape
    with pytest.raises(DataError):
        pixels_of(content | wrong)
    one_row = plain("rgb8", pixels=PIXELS[:1]) | {"step": 1 << 40}
    np.testing.assert_array_equal(pixels_of(one_row), PIXELS[:1])
