"""Reading MJCF and URDF that nobody vouches for: checked before MuJoCo sees it.

The text is parsed without entities, document types or the network (defusedxml), and is limited in
size, depth and elements. Files that it names (meshes, height fields, includes) must lie in its own
folder, links followed; they are handed to MuJoCo as bytes, so that it opens nothing itself. What
only draws (textures, skins, a URDF's shapes) is left out; what could run or grow without limit
(plugins, soft bodies, a thousand copies) is refused.

>>> read_text("<mujoco><worldbody/></mujoco>").kind
'mujoco'
>>> read_text('<mujoco><include file="../other.xml"/></mujoco>')
Traceback (most recent call last):
evertwin.errors.ModelError: model.xml: <include> names '../other.xml', which is not in its folder...
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element, ParseError, SubElement, tostring

from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from evertwin.errors import ModelError

LARGEST = 8_000_000
"""Characters of XML, includes counted."""
ASSETS = 256_000_000
"""Bytes of all files that the model names."""
DEEPEST, ELEMENTS, COPIES = 200, 100_000, 1000
_REFUSED = ("plugin", "extension", "composite", "flexcomp", "flex", "deformable")
"""Code to be loaded, or bodies without number: rigid bodies are what is simulated here."""
_IDLE = ("texture", "skin", "visual", "statistic", "custom", "size")
"""Seen, not felt, or memory by hand; some of them can be of any size."""
_HEIGHTS = 4_000_000


@dataclass(frozen=True)
class Source:
    """A checked model: text, the bytes of the files it names, and what was left out.

    >>> Source("<robot/>", "robot").assets
    {}
    """

    text: str
    kind: str
    """``mujoco`` or ``robot`` (URDF)."""
    assets: Mapping[str, bytes] = field(default_factory=dict)
    where: str = "model.xml"
    """Opens every message."""
    notes: tuple[str, ...] = ()


def read_file(path: Path | str) -> Source:
    """The checked model in a file; files that it names are looked for in its folder.

    Raises:
        ModelError: it cannot be read, or holds what is refused.
    """
    path = Path(path)
    return _source(_text(path, path.name), path.name, path.parent)


def read_text(text: str, where: str = "model.xml") -> Source:
    """The checked model in a text; it cannot name files."""
    return _source(text, where, None)


def _text(path: Path, where: str) -> str:
    try:
        if path.stat().st_size > LARGEST:
            raise ModelError(f"{where}: expected at most {LARGEST} bytes of XML: split the model")
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{where}: expected a readable MJCF or URDF file: {error}") from error


def _source(text: str, where: str, folder: Path | None) -> Source:
    top = _parse(text, where)
    if top.tag not in ("mujoco", "robot"):
        raise ModelError(f"{where}: expected <mujoco> (MJCF) or <robot> (URDF), got <{top.tag}>")
    reader = _Reader(where, folder)
    if top.tag == "robot":
        notes = _bare_urdf(top)
    else:
        reader.include(top, ())
        notes = reader.clean(top)
        reader.collect(top)
    return Source(tostring(top, encoding="unicode"), top.tag, reader.assets, where, notes)


def _parse(text: str, where: str) -> Element:
    if len(text) > LARGEST:
        raise ModelError(f"{where}: expected at most {LARGEST} characters, got {len(text)}")
    try:
        top: Element = ElementTree.fromstring(text, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError, RecursionError) as error:
        raise ModelError(f"{where}: expected plain XML without entities, got {error}") from error
    _limited(top, where)
    return top


def _limited(top: Element, where: str) -> None:
    """Depth, number of elements and of copies."""
    level, depth, count = [(top, 1)], 0, 0
    while level:
        depth += 1
        count += len(level)
        if depth > DEEPEST or count > ELEMENTS:
            raise ModelError(
                f"{where}: expected at most {DEEPEST} levels and {ELEMENTS} elements, got "
                f"{'more levels' if depth > DEEPEST else 'more elements'}"
            )
        level = [(child, _copies(child, times, where)) for e, times in level for child in e]


def _copies(element: Element, times: int, where: str) -> int:
    if element.tag != "replicate":
        return times
    text = element.get("count", "1")
    if not text.strip().isdigit() or times * int(text) > COPIES:
        raise ModelError(f"{where}: <replicate> asks for {text!r} copies, expected ≤ {COPIES}")
    return times * max(1, int(text))


def _bare_urdf(top: Element) -> tuple[str, ...]:
    """Leaves shapes out: the dynamics come from <inertial>, and mesh files are often absent."""
    shapes = sum(1 for _ in top.iter("visual")) + sum(1 for _ in top.iter("collision"))
    meshes = sorted({m.get("filename", "") for m in top.iter("mesh")})
    for link in top.iter("link"):
        for part in [e for e in link if e.tag in ("visual", "collision")]:
            link.remove(part)
    for part in [e for e in top if e.tag not in ("link", "joint")]:
        top.remove(part)
    compiler = {"fusestatic": "false", "discardvisual": "true", "strippath": "true"}
    SubElement(SubElement(top, "mujoco"), "compiler", compiler)
    if not shapes:
        return ()
    named = f", mesh files {', '.join(meshes[:3])} … not read" if meshes else ""
    return (f"{shapes} shapes are left out: no contact is simulated{named}",)


class _Reader:
    """Walks an MJCF document and collects the files that it names."""

    def __init__(self, where: str, folder: Path | None) -> None:
        self.where, self.folder = where, folder
        self.assets: dict[str, bytes] = {}
        self.read = 0

    def include(self, top: Element, above: tuple[str, ...]) -> None:
        """Puts included files in their place."""
        for parent in list(top.iter()):
            while found := [e for e in parent if e.tag == "include"]:
                element = found[0]
                name = element.get("file", "")
                if name in above or len(above) > 20:
                    raise ModelError(f"{self.where}: <include> of {name!r} includes itself")
                text = _text(self._path("include", name), name)
                self._count("include", name, len(text), LARGEST)
                inner = _parse(text, name)
                self.include(inner, (*above, name))
                at = list(parent).index(element)
                parent[at : at + 1] = list(inner)
        _limited(top, self.where)

    def clean(self, top: Element) -> tuple[str, ...]:
        """Refuses what may not be there and drops what only draws."""
        dropped: dict[str, int] = {}
        for parent in list(top.iter()):
            for element in list(parent):
                if element.tag in _REFUSED:
                    raise ModelError(
                        f"{self.where}: <{element.tag}> is not supported: only rigid bodies, "
                        "joints, actuators, tendons and sensors of MuJoCo itself are"
                    )
                if element.tag in _IDLE:
                    parent.remove(element)
                    dropped[element.tag] = dropped.get(element.tag, 0) + 1
        for material in [e for e in top.iter() if e.tag in ("material", "light")]:
            material.attrib.pop("texture", None)
            for layer in list(material):
                material.remove(layer)
        for field_ in top.iter("hfield"):
            self._heights(field_.get("nrow", "0"), field_.get("ncol", "0"))
        if not dropped:
            return ()
        return ("left out: " + ", ".join(f"{n} <{tag}>" for tag, n in sorted(dropped.items())),)

    def collect(self, top: Element) -> None:
        """Reads the files that are left, under the names that MuJoCo will ask for."""
        folders = {"mesh": "", "hfield": "", "model": ""}
        for compiler in top.iter("compiler"):
            shared = compiler.attrib.pop("assetdir", None)
            folders["mesh"] = compiler.attrib.pop("meshdir", shared or folders["mesh"])
            compiler.attrib.pop("texturedir", None)
        for element in list(top.iter()):
            name = element.get("file")
            if name is None:
                continue
            if element.tag not in folders:
                raise ModelError(f"{self.where}: <{element.tag}> may not name a file ({name!r})")
            inside = str(PurePosixPath(folders[element.tag]) / name)
            path = self._path(element.tag, inside)
            if element.tag == "model":
                raise ModelError(
                    f"{self.where}: <model file={name!r}> is not supported: include the file"
                )
            self._count(element.tag, inside, path.stat().st_size, ASSETS)
            element.set("file", inside)
            data = path.read_bytes()
            if data.startswith(b"\x89PNG"):
                wide, high = (int.from_bytes(data[k : k + 4], "big") for k in (16, 20))
                self._heights(str(high), str(wide))
            self.assets[inside] = data

    def _heights(self, rows: str, columns: str) -> None:
        if not (rows.isdigit() and columns.isdigit()) or int(rows) * int(columns) > _HEIGHTS:
            raise ModelError(
                f"{self.where}: a <hfield> of {rows} x {columns}, expected ≤ {_HEIGHTS} points"
            )

    def _count(self, tag: str, name: str, size: int, most: int) -> None:
        self.read += size
        if self.read > most:
            raise ModelError(
                f"{self.where}: <{tag}> names {name!r}; with it the files have {self.read} bytes, "
                f"expected at most {most}"
            )

    def _path(self, tag: str, name: str) -> Path:
        """The file, proved to lie in the model's folder."""
        said = f"{self.where}: <{tag}> names {name!r}"
        parts = PurePosixPath(name.replace("\\", "/"))
        foreign = ":" in name or parts.is_absolute() or ".." in parts.parts or "\0" in name
        if self.folder is None or foreign or not name:
            raise ModelError(f"{said}, which is not in its folder: put it beside the model")
        path = (self.folder / parts).resolve()
        if not path.is_relative_to(self.folder.resolve()):
            raise ModelError(f"{said}, a link that leaves its folder: put the file itself there")
        if not path.is_file():
            raise ModelError(f"{said}, which is not there: add the file or take the element out")
        return path
