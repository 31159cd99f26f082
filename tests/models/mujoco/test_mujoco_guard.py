"""MJCF and URDF that nobody vouches for: nothing outside the folder is read, nothing explodes."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.errors import ModelError
from evertwin.models.mujoco import MuJoCo
from evertwin.models.mujoco.guard import read_file, read_text

BODY = '<body><joint/><geom size=".1"/></body>'


def mesh(file: str) -> str:
    return mjcf(f'<asset><mesh file="{file}"/></asset>')


def mjcf(inside: str) -> str:
    return f"<mujoco>{inside}<worldbody>{BODY}</worldbody></mujoco>"


BILLION = '<!DOCTYPE m [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]><mujoco model="&b;"/>'
CORPUS = {
    "entities": (BILLION, "without entities"),
    "external entity": (
        '<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco/>', "without entities",
    ),
    "external document type": ('<!DOCTYPE m SYSTEM "http://localhost/m.dtd"><mujoco/>', "without"),
    "no XML": ("mujoco", "expected plain XML"),
    "other file": ("<sdf/>", "expected <mujoco>"),
    "deep": ("<mujoco>" + "<body>" * 300 + "</body>" * 300 + "</mujoco>", "200 levels"),
    "many": (mjcf("<x/>" * 100_001), "100000 elements"),
    "copies": (mjcf('<replicate count="1000000"/>'), "1000000' copies"),
    "copies of copies": (
        mjcf('<replicate count="100"><replicate count="100"/></replicate>'), "'100' copies",
    ),
    "negative copies": (mjcf('<replicate count="-1"/>'), "'-1' copies"),
    "plugin": (mjcf('<extension><plugin plugin="x"/></extension>'), "<extension> is not supported"),
    "soft body": (mjcf('<deformable><flex name="f"/></deformable>'), "is not supported"),
    "mesh above": (mesh("../a.stl"), "not in its folder"),
    "mesh absolute": (mesh("/etc/passwd"), "not in its folder"),
    "mesh of a package": (mesh("package://a/b.stl"), "not in its folder"),
    "mesh on another drive": (mesh("C:\\\\a.stl"), "not in its folder"),
    "mesh by a folder": (
        mjcf('<compiler meshdir="../.."/><asset><mesh file="a.stl"/></asset>'), "not in its folder",
    ),
    "mesh that is absent": (mesh("a.stl"), "not there"),
    "model in a model": (
        mjcf('<asset><model name="m" file="model.xml"/></asset>'), "is not supported",
    ),
    "file of another element": (mjcf('<keyframe file="model.xml"/>'), "may not name a file"),
    "include above": (mjcf('<include file="../m.xml"/>'), "not in its folder"),
    "include of itself": (mjcf('<include file="model.xml"/>'), "includes itself"),
    "heights": (mjcf('<asset><hfield nrow="99999" ncol="99999"/></asset>'), "4000000 points"),
    "nothing MuJoCo knows": (mjcf("<banana/>"), "MuJoCo refuses"),
    "negative mass": (
        mjcf('<worldbody><body><joint/><inertial pos="0 0 0" mass="-1" diaginertia="1 1 1"/></body>'
             "</worldbody>"), "MuJoCo refuses",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CORPUS)
def test_what_cannot_be_trusted_is_refused_by_name(case: str, tmp_path: Path) -> None:
    text, message = CORPUS[case]
    path = tmp_path / "model.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        MuJoCo.of(path)
    assert str(caught.value).startswith("model.xml") and message in str(caught.value)


def test_a_link_that_leaves_the_folder_is_refused(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.stl").write_text("solid secret")
    (inside / "a.stl").symlink_to(tmp_path / "secret.stl")
    (inside / "m.xml").write_text(mesh("a.stl"), encoding="utf-8")
    with pytest.raises(ModelError, match="a link that leaves its folder"):
        read_file(inside / "m.xml")


def test_too_large_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.xml"
    path.write_bytes(b" " * 9_000_000)
    with pytest.raises(ModelError, match="at most 8000000 bytes"):
        read_file(path)
    with pytest.raises(ModelError, match="expected a readable MJCF"):
        read_file(tmp_path / "absent.xml")


TETRAHEDRON = """v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"""


def test_meshes_and_includes_in_the_folder_are_used(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "t.obj").write_text(TETRAHEDRON)
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body><joint name="j"/><geom type="mesh" mesh="t"/></body></worldbody>'
        "</mujoco>"
    )
    main = mjcf('<compiler meshdir="parts"/><asset><mesh name="t" file="t.obj"/></asset>')
    (tmp_path / "m.xml").write_text(
        main.replace("<worldbody>", '<include file="arm.xml"/><worldbody>')
    )
    model = MuJoCo.of(tmp_path / "m.xml")
    assert model.compiled.nmesh == 1 and "j.pos" in model.states.names


def test_a_picture_of_any_size_is_left_out() -> None:
    texture = (
        '<asset><texture name="t" type="2d" builtin="flat" width="100000" height="100000"/></asset>'
    )
    source = read_text(mjcf(texture))
    assert "texture" not in source.text and "1 <texture>" in source.notes[0]


def test_a_urdf_is_read_without_its_shapes() -> None:
    text = """<robot name="r"><link name="base"/><link name="rod"><visual><geometry>
      <mesh filename="package://x/../../secret.dae"/></geometry></visual><inertial>
      <origin xyz="0 0 -.3"/><mass value="1"/><inertia ixx=".02" ixy="0" ixz="0" iyy=".02" iyz="0"
      izz=".001"/></inertial></link><joint name="pivot" type="continuous"><parent link="base"/>
      <child link="rod"/><axis xyz="0 1 0"/>
      <dynamics damping="0.3" friction="0.1"/></joint></robot>"""
    model = MuJoCo.from_text(text)
    assert model.inputs.names == ("pivot.torque",) and model.compiled.ngeom == 0
    assert model.parameters["joint.pivot.damping"].value == 0.3
    assert model.parameters["joint.pivot.frictionloss"].value == 0.1
    assert "1 shapes are left out" in model.source.notes[0]
