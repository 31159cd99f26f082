"""Bad files, generated: archives (M1), XML (M2), pickles (M3), FMU packages (M4), URDFs (M5)."""

from __future__ import annotations

import io
import pickle
import random
import stat
import struct
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from .native import description

GOOD_XML = description(False, "c", False, True)
Fill = Callable[[zipfile.ZipFile], None]


def packed(fill: Fill, method: int = zipfile.ZIP_DEFLATED, xml: str | None = GOOD_XML) -> bytes:
    """An archive with a good description and something bad."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with zipfile.ZipFile(buffer, "w", method) as archive:
            if xml is not None:
                archive.writestr("modelDescription.xml", xml)
            archive.writestr("binaries/linux64/mass.so", b"not a library")
            fill(archive)
    return buffer.getvalue()


def entry(name: str, content: bytes = b"x", mode: int = 0, flags: int = 0) -> Fill:
    def fill(archive: zipfile.ZipFile) -> None:
        info = zipfile.ZipInfo("placeholder")
        info.filename = info.orig_filename = name
        info.external_attr = mode << 16
        info.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(info, content)
        info.flag_bits |= flags

    return fill


def many(count: int) -> Fill:
    def fill(archive: zipfile.ZipFile) -> None:
        for k in range(count):
            archive.writestr(f"resources/{k}", b"")

    return fill


def twice(a: str, b: str) -> Fill:
    def fill(archive: zipfile.ZipFile) -> None:
        archive.writestr(a, "one")
        archive.writestr(b, "two")

    return fill


def zeros(count: int, size: int) -> Fill:
    def fill(archive: zipfile.ZipFile) -> None:
        block = bytes(1 << 20)
        for k in range(count):
            with archive.open(f"resources/zero{k}", "w") as file:
                for _ in range(size >> 20):
                    file.write(block)

    return fill


def noise(size: int) -> Fill:
    rng = random.Random(0)
    return lambda archive: archive.writestr("resources/noise", rng.randbytes(size))


def lying(raw: bytes, name: bytes, size: int) -> bytes:
    """The central directory and the local header say another unpacked size."""
    out = bytearray(raw)
    for signature, length, where in ((b"PK\x01\x02", 24, 46), (b"PK\x03\x04", 22, 30)):
        at = -1
        while (at := raw.find(signature, at + 1)) >= 0:
            if raw[at + where : at + where + len(name)] == name:
                out[at + length : at + length + 4] = struct.pack("<I", size)
    return bytes(out)


def archives(large: bool = True) -> Iterator[tuple[str, bytes]]:
    """M1: each must be refused, with nothing written outside and nothing kept inside."""
    names = {
        "traversal": "../escape.txt", "deep traversal": "resources/../../escape.txt",
        "traversal at the end": "resources/..", "absolute": "/tmp/escape.txt",
        "two slashes": "//escape/share.txt", "drive": "C:/escape.txt", "drive relative": "C:escape",
        "backslash": "resources\\escape.txt", "backslash traversal": "..\\..\\escape.txt",
        "unc": "\\\\server\\share", "newline": "resources/a\nb", "bell": "resources/\x07",
        "long part": "resources/" + "a" * 300, "long path": "/".join(["d" * 200] * 8),
        "nested zip": "resources/inner.zip", "nested fmu": "resources/INNER.FMU",
        "nested tar": "resources/a.tar.gz", "nested 7z": "resources/a.7z",
    }  # fmt: skip
    for kind, name in names.items():
        yield kind, packed(entry(name))
    for kind, mode in {
        "symlink": stat.S_IFLNK, "device": stat.S_IFBLK, "character device": stat.S_IFCHR,
        "pipe": stat.S_IFIFO, "socket": stat.S_IFSOCK,
    }.items():  # fmt: skip
        yield kind, packed(entry("resources/x", b"/etc/passwd", mode | 0o777))
    yield "encrypted", packed(entry("resources/x", flags=0x1))
    yield "strongly encrypted", packed(entry("resources/x", flags=0x41))
    yield "same name", packed(twice("resources/x", "resources/x"))
    yield "same name but for case", packed(twice("resources/x", "resources/X"))
    yield "two descriptions", packed(lambda a: a.writestr("modelDescription.xml", GOOD_XML))
    yield "file as a folder", packed(twice("resources/x", "resources/x/y"))
    if large:
        yield "too many files", packed(many(10_001), zipfile.ZIP_STORED)
        yield "bomb in one file", packed(zeros(1, 200 << 20))
        yield "bomb in many files", packed(zeros(8, 40 << 20))
        yield "too large in all", packed(zeros(1, 300 << 20), zipfile.ZIP_STORED)
        yield "bomb in the description", packed(lambda a: None, xml=GOOD_XML + " " * (40 << 20))
    whole = packed(noise(1 << 20))
    yield "says less than it holds", lying(packed(zeros(1, 20 << 20)), b"resources/zero0", 1000)
    yield "says far more", lying(whole, b"resources/noise", 0xFFFFFFF0)
    yield "cut in the middle", whole[: len(whole) // 2]
    yield "cut at the end", whole[:-10]
    yield "damaged", whole[:2000] + bytes(len(whole) - 3000) + whole[-1000:]
    yield "empty", b""
    yield "no archive", b"hello" * 1000
    yield "no description", packed(lambda a: None, xml=None)
    method = bytearray(whole)
    at = whole.rfind(b"PK\x01\x02")
    method[at + 10 : at + 12] = struct.pack("<H", 97)
    yield "unknown compression", bytes(method)


def doctype(inside: str, body: str = "&x;") -> str:
    return f"<!DOCTYPE fmiModelDescription [{inside}]><fmiModelDescription>{body}" + (
        "</fmiModelDescription>"
    )


def xml_texts(canary: Path, port: int) -> Iterator[tuple[str, str]]:
    """M2: with another top element they serve for URDF and MJCF too."""
    yield "entity from a file", doctype(f'<!ENTITY x SYSTEM "file://{canary}">')
    yield "entity from the network", doctype(f'<!ENTITY x SYSTEM "http://127.0.0.1:{port}/x">')
    yield "parameter entity", doctype(f'<!ENTITY % p SYSTEM "http://127.0.0.1:{port}/p"> %p;', "")
    yield "document type in a file", f'<!DOCTYPE fmiModelDescription SYSTEM "file://{canary}"><a/>'
    yield (
        "public document type",
        (f'<!DOCTYPE fmiModelDescription PUBLIC "-//X//" "http://127.0.0.1:{port}/d"><a/>'),
    )
    laughs = '<!ENTITY a "ha">' + "".join(
        f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(12)
    )
    yield "billion laughs", doctype(laughs, "&m;")
    yield "quadratic", doctype(f'<!ENTITY x "{"A" * 100_000}">', "&x;" * 10_000)
    yield "recursion", doctype('<!ENTITY x "&y;"><!ENTITY y "&x;">')
    deep = 100_000
    yield "deep", "<fmiModelDescription>" + "<a>" * deep + "</a>" * deep + "</fmiModelDescription>"
    yield "many", "<fmiModelDescription>" + "<a/>" * 600_000 + "</fmiModelDescription>"
    yield "huge", "<fmiModelDescription>" + "a" * 33_000_000 + "</fmiModelDescription>"
    yield "no end", "<fmiModelDescription><a>"
    yield "no text", ""
    yield "zero byte", "<fmiModelDescription>\0</fmiModelDescription>"
    yield "odd encoding", '<?xml version="1.0" encoding="rot13"?><fmiModelDescription/>'
    yield (
        "external schema",
        (
            '<fmiModelDescription xmlns:s="http://www.w3.org/2001/XMLSchema-instance" '
            f's:noNamespaceSchemaLocation="http://127.0.0.1:{port}/s" fmiVersion="2.0"/>'
        ),
    )
    yield (
        "inclusion",
        (
            '<fmiModelDescription xmlns:i="http://www.w3.org/2001/XInclude" fmiVersion="2.0">'
            f'<i:include href="file://{canary}"/></fmiModelDescription>'
        ),
    )


class Fire:
    """Unpickling it makes a file."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> Any:
        return open, (str(self.target), "w")


ENDINGS = (
    ".pkl", ".joblib", ".csv", ".mat", ".npz", ".npy", ".parquet", ".fmu", ".urdf", ".xml", ".mo",
    ".json", ".db", ".toml", ".mcap",
)  # fmt: skip


def pickles(canary: Path) -> Iterator[tuple[str, str, bytes]]:
    """M3: (name, ending, content); each reader may refuse it, none may load it."""
    for protocol in (0, 2, 5):
        raw = pickle.dumps(Fire(canary), protocol)
        for ending in ENDINGS:
            yield f"pickle {protocol} as {ending}", ending, raw
    boxed = np.array([Fire(canary)], dtype=object)
    buffer = io.BytesIO()
    np.save(buffer, boxed, allow_pickle=True)
    yield "object array", ".npy", buffer.getvalue()
    buffer = io.BytesIO()
    np.savez(buffer, t=np.arange(3.0), x=boxed)
    yield "object in npz", ".npz", buffer.getvalue()
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, {"t": np.arange(3.0), "x": np.array([{"a": 1}], dtype=object)})
    yield "cells in mat", ".mat", buffer.getvalue()
    yield (
        "pickle in an fmu",
        ".fmu",
        packed(entry("resources/weights.pkl", pickle.dumps(Fire(canary)))),
    )


LINK = ('<link name="{name}"><inertial><origin xyz="0 0 0.1"/><mass value="{mass}"/>'
        '<inertia ixx="{ixx}" ixy="{ixy}" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
        "{more}</link>")  # fmt: skip
JOINT = ('<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
         '<axis xyz="{axis}"/>{more}</joint>')  # fmt: skip


def link(name: str = "rod", mass: Any = 1.0, ixx: Any = 0.1, ixy: Any = 0, more: str = "") -> str:
    return LINK.format(name=name, mass=mass, ixx=ixx, ixy=ixy, more=more)


def joint(
    name: str = "pivot", kind: str = "revolute", parent: str = "wall", child: str = "rod",
    axis: str = "0 1 0", more: str = "",
) -> str:  # fmt: skip
    return JOINT.format(name=name, kind=kind, parent=parent, child=child, axis=axis, more=more)


def robot(*parts: str) -> str:
    return '<robot name="r"><link name="wall"/>' + "".join(parts) + "</robot>"


def urdfs() -> Iterator[tuple[str, str, str]]:
    """M5: (name, text, word that the message must hold: the element at fault)."""
    yield "zero mass", robot(link(mass=0), joint()), "rod"
    yield "negative mass", robot(link(mass=-1), joint()), "rod"
    yield "mass that is no number", robot(link(mass="heavy"), joint()), "rod"
    yield "mass not finite", robot(link(mass="nan"), joint()), "rod"
    yield "infinite mass", robot(link(mass="inf"), joint()), "rod"
    yield "negative inertia", robot(link(ixx=-0.1), joint()), "rod"
    yield "indefinite inertia", robot(link(ixy=5), joint()), "rod"
    yield "no inertia", robot('<link name="rod"><inertial><mass value="1"/></inertial></link>',
                              joint()), "rod"  # fmt: skip
    yield "loop", robot(link("a"), link("b"), joint("i", parent="a", child="b"),
                        joint("k", parent="b", child="a")), "loop"  # fmt: skip
    yield "carried by itself", robot(link(), joint(parent="rod")), "rod"
    yield "two carriers", robot(link(), joint("i"), joint("k")), "rod"
    yield "two roots", robot(link()), "rod"
    yield "link that is absent", robot(link(), joint(child="arm")), "arm"
    yield "same link twice", robot(link(), link(), joint()), "rod"
    yield "same joint twice", robot(link(), joint(), joint()), "pivot"
    yield "joint without name", robot(link(), joint(name="")), "joint"
    yield "joint without child", robot(link(), joint(child="")), "pivot"
    yield "axis of length zero", robot(link(), joint(axis="0 0 0")), "pivot"
    yield "axis of two numbers", robot(link(), joint(axis="0 1")), "pivot"
    yield "unknown kind", robot(link(), joint(kind="wobbly")), "pivot"
    yield "mimic", robot(link(), joint(more='<mimic joint="x"/>')), "pivot"
    yield "other file", "<mujoco/>", "robot"
    yield "no XML", "robot", "XML"
    yield "entity", '<!DOCTYPE robot [<!ENTITY x "1">]><robot name="&x;"/>', "entities"


def meshes() -> Iterator[tuple[str, str]]:
    """M5: files that the dynamics do not need, named in ways that must never be opened."""
    for name in ("absent.stl", "package://other/../../etc/passwd", "package://x/y.dae",
                 "file:///etc/passwd", "../../../etc/passwd", "/etc/passwd",
                 "http://127.0.0.1:9/m.stl"):  # fmt: skip
        shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        yield name, robot(link(more=shape), joint())
