"""A valid file of every kind that a stranger may hand over, each with the command that reads it.

Recordings hold x = 10·t + 0.25 and y = −20·t over 120 rows: a call takes milliseconds.
"""

from __future__ import annotations

import gzip
import io
import json
import sqlite3
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import mcap.writer
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from rosbags.rosbag1 import Writer as Writer1
from rosbags.typesys import Stores, get_typestore

from tests.engineering.axis import AXIS

__all__ = ["SEEDS", "Seed"]

N = 120
T = np.arange(N) / 10
X = 10 * T + 0.25
Y = -20 * T
INFO = ("info", "{file}")
INIT = ("init", "{file}", "-o", "made.toml", "--force")


@dataclass(frozen=True)
class Seed:
    """One kind of file.

    ``{file}`` in a command stands for the file that is mutated; ``beside`` are files that stay.
    """

    file: str
    content: bytes
    commands: tuple[tuple[str, ...], ...] = (INFO, INIT)
    beside: dict[str, bytes] = field(default_factory=dict)
    binary: bool = False
    reader: str = ""
    """Another reader of its values, see `tests.edge.readers`."""


def table(
    sign: str = ",", decimal: str = ".", head: tuple[str, ...] = ("t [s],x [m],y [mm]",)
) -> bytes:
    rows = [line.replace(",", sign) for line in head]
    rows += [
        sign.join(f"{v:.2f}" for v in row).replace(".", decimal)
        for row in zip(T, X, Y, strict=True)
    ]
    return ("\n".join(rows) + "\n").encode()


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npz() -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, t=T, x=X, y=Y)
    return buffer.getvalue()


def mat(packed: bool) -> bytes:
    buffer = io.BytesIO()
    content = {"t": T, "log": {"x": X, "y": Y}, "note": "run 7", "k": 3.0, "on": T > 5}
    scipy.io.savemat(buffer, content, do_compression=packed)
    return buffer.getvalue()


def mat73() -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        for name, values in (("t", T), ("x", X), ("y", Y)):
            made = file.create_dataset(name, data=values[None, :])
            made.attrs["MATLAB_class"] = np.bytes_("double")
    raw = buffer.getvalue()
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    return head.ljust(512, b"\0") + raw[512:]


def parquet() -> bytes:
    buffer = io.BytesIO()
    pq.write_table(pa.table({"t": T, "x": X, "y": Y, "on": T > 5}), buffer)
    return buffer.getvalue()


def mcap_file(packed: bool) -> bytes:
    buffer = io.BytesIO()
    how = mcap.writer.CompressionType.ZSTD if packed else mcap.writer.CompressionType.NONE
    writer = mcap.writer.Writer(buffer, chunk_size=2000, compression=how)
    writer.start()
    schema = writer.register_schema("drive", "jsonschema", b"{}")
    channel = writer.register_channel("/drive", "json", schema)
    for t, x, y in zip(T, X, Y, strict=True):
        stamp = round(t * 1e9)
        writer.add_message(channel, stamp, json.dumps({"x": x, "y": y}).encode(), stamp)
    writer.finish()
    return buffer.getvalue()


def ros1(packed: str) -> bytes:
    store = get_typestore(Stores.ROS1_NOETIC)
    point = store.types["geometry_msgs/msg/Point"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.bag"
        writer = Writer1(path)
        writer.chunk_threshold = 1500
        if packed:
            writer.set_compression(Writer1.CompressionFormat[packed])
        with writer:
            link = writer.add_connection("/point", "geometry_msgs/msg/Point", typestore=store)
            for t, x, y in zip(T, X, Y, strict=True):
                data = store.serialize_ros1(point(x=x, y=y, z=0.0), "geometry_msgs/msg/Point")
                writer.write(link, 10**9 + round(t * 1e9), data)
        return path.read_bytes()


def db3() -> bytes:
    link = sqlite3.connect(":memory:")
    link.execute("CREATE TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)")
    link.execute(
        "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    )
    link.execute("INSERT INTO topics VALUES(1, '/x', 'std_msgs/msg/Float64', 'cdr')")
    for i, (t, x) in enumerate(zip(T, X, strict=True)):
        data = b"\0\1\0\0" + struct.pack("<d", x)
        link.execute("INSERT INTO messages VALUES(?, 1, ?, ?)", (i, round(t * 1e9), data))
    link.commit()
    return bytes(link.serialize())


TWIN = b"""schema = 1
name = "robot"
beat = 20
[model]
kind = "robot1d"
parameters.gain = { value = 1.0, low = 0.5, high = "150 %" }
[[source]]
name = "log"
files = ["run.csv"]
time = { column = "t", unit = "s" }
[source.channels]
v = { column = "v", unit = "cm/s", scale = 1.0 }
x = { column = "x", unit = "cm" }
[signals.x]
low = "-1 km"
high = 1000
[clock]
gap = "10 s"
[arbiter]
use = "tolerance"
tolerance = "3 cm"
vote = 8
[prediction]
horizon = "1 s"
[anomaly]
requirement = "0.5 cm"
window = 40
[tuning]
window = "10 s"
every = "5 s"
[trial]
alpha = 0.01
segments = 20
"""
LIFE = b"""[store]
path = "twin.db"
[[indicator]]
name = "friction"
component = "gearbox"
unit = "Nm"
limit = 18
[prognosis.components.gearbox]
failure = 9000
maintenance = 900
[prognosis]
windows = 5
ahead = "30 run"
"""


def drive() -> bytes:
    rng = np.random.default_rng(3)
    v = 20.0 + 10.0 * (rng.random(N) > 0.5)
    x = np.concatenate([[0.0], np.cumsum(0.9 * v[1:] * 0.1)]) + rng.normal(0.0, 0.05, N)
    rows = [f"{t:.1f},{a:.1f},{b:.4f}" for t, a, b in zip(T, v, x, strict=True)]
    return ("t,v,x\n" + "\n".join(rows) + "\n").encode()


ARM = b"""<?xml version="1.0"?>
<robot name="a"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0 0"/>
<mass value="2.5"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
</inertial><visual><geometry><mesh filename="package://a/b.stl"/></geometry></visual></link>
<joint name="j1" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<origin xyz="0 0 0.3" rpy="0 0 0"/>
<limit lower="-3" upper="3" effort="9" velocity="2"/></joint></robot>
"""
ARM_TWIN = b"""schema = 1
name = "arm"
[model]
kind = "arm"
options = { urdf = "arm.urdf" }
"""
HISTORY = (
    "run,friction [Nm],maintenance\n"
    + "\n".join(
        f"{k + 1},{12.0 + 0.1 * k + 0.05 * (k % 3):.3f},{'' if k else 'new'}" for k in range(40)
    )
    + "\n"
).encode()
SCENARIO = b"""schema = 1
name = "slower"
horizon = "5 s"
[speed]
factor = 0.8
[parameters]
gain = { factor = 1.1 }
[limits]
v = "1 m/s"
"""
PATH = ("t,v\n" + "\n".join(f"{t:.1f},{0.2:.2f}" for t in T[:60]) + "\n").encode()
PATH_SCENARIO = b'schema = 1\nname = "path"\n[path]\nfile = "path.csv"\nrate = "10 Hz"\n'
VALUES = json.dumps({
    "schema": "evertwin.parameters/1", "name": "robot",
    "parameters": {"gain": {"value": 0.95, "unit": "1"}},
}, indent=1).encode()  # fmt: skip
BESIDE = {"robot.toml": TWIN, "run.csv": drive()}
KEPT = {"robot.toml": TWIN + LIFE, "run.csv": drive()}


def _seeds() -> dict[str, Callable[[], Seed]]:
    life = (("life", "robot.toml", "--history", "{file}"),)
    what = (("whatif", "robot.toml", "--scenario", "{file}"),)
    run = (("run", "{file}"), ("doctor", "{file}"))
    return {
        "csv": lambda: Seed("a.csv", table(), reader="csv"),
        "csv, semicolons": lambda: Seed("a.csv", table(";", ","), reader="csv"),
        "csv, three headings": lambda: Seed(
            "a.csv", table(";", head=("Time,Way along x,Way along y", "s,m,mm", "t,x,y")),
            reader="csv",
        ),
        "tsv": lambda: Seed("a.tsv", table("\t"), reader="csv"),
        "text without headings": lambda: Seed("a.txt", table(" ", head=()), reader="csv"),
        "csv, dates": lambda: Seed("a.csv", b"time,x,y\n" + b"".join(
            b"2021-03-04T12:00:%02d.%dZ,%.2f,%.2f\n" % (i // 10, i % 10, X[i], Y[i])
            for i in range(N)
        ), reader="csv"),
        "csv.gz": lambda: Seed("a.csv.gz", gzip.compress(table(), mtime=0), binary=True,
                               reader="csv"),
        "csv, run": lambda: Seed("run.csv", drive(), (("run", "robot.toml"),), {"robot.toml": TWIN},
                                 reader="csv"),
        "json": lambda: Seed("a.json", VALUES, (INFO,)),
        "npy": lambda: Seed("a.npy", npy(np.rec.fromarrays([T, X, Y], names="t,x,y")), binary=True,
                            reader="npy"),
        "npz": lambda: Seed("a.npz", npz(), binary=True, reader="npz"),
        "mat 5": lambda: Seed("a.mat", mat(False), binary=True, reader="mat"),
        "mat 5, packed": lambda: Seed("a.mat", mat(True), binary=True, reader="mat"),
        "mat 7.3": lambda: Seed("a.mat", mat73(), binary=True, reader="mat73"),
        "parquet": lambda: Seed("a.parquet", parquet(), binary=True, reader="parquet"),
        "mcap": lambda: Seed("a.mcap", mcap_file(False), binary=True, reader="mcap"),
        "mcap, packed": lambda: Seed("a.mcap", mcap_file(True), binary=True, reader="mcap"),
        "ros 1 bag": lambda: Seed("a.bag", ros1(""), binary=True, reader="ros1"),
        "ros 1 bag, packed": lambda: Seed("a.bag", ros1("LZ4"), binary=True, reader="ros1"),
        "ros 2 db3": lambda: Seed("a.db3", db3(), (INFO,), binary=True, reader="db3"),
        "twin file": lambda: Seed("robot.toml", TWIN + LIFE, run, {"run.csv": drive()},
                                  reader="toml"),
        "arm's twin file": lambda: Seed("arm.toml", ARM_TWIN, (("doctor", "{file}"),),
                                        {"arm.urdf": ARM}, reader="toml"),
        "urdf": lambda: Seed("arm.urdf", ARM, (("doctor", "arm.toml"),), {"arm.toml": ARM_TWIN},
                             reader="urdf"),
        "breakdown file": lambda: Seed("b.toml", AXIS.encode(),
                                       (("engineer", "{file}", "-o", "made.toml", "--force"),)),
        "scenario file": lambda: Seed("s.toml", SCENARIO, what, BESIDE),
        "path of a scenario": lambda: Seed("path.csv", PATH, (
            ("whatif", "robot.toml", "--scenario", "s.toml"),), BESIDE | {"s.toml": PATH_SCENARIO}),
        "history": lambda: Seed("h.csv", HISTORY, life, KEPT, reader="history"),
        "inputs to come": lambda: Seed("i.csv", PATH, (
            ("forecast", "robot.toml", "--inputs", "{file}", "--horizon", "5 s"),), BESIDE),
        "parameters": lambda: Seed("p.json", VALUES, (("model", "load", "robot.toml", "{file}"),),
                                   KEPT),
    }  # fmt: skip


SEEDS: dict[str, Callable[[], Seed]] = _seeds()
"""Kind → what makes its file."""
