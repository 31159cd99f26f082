"""URDF files that no machine can be: each refused with the element named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import ModelError
from evertwin.machines.arm import Arm
from evertwin.machines.arm.chain import serial
from evertwin.machines.arm.urdf import parse, read

INERTIAL = """<inertial><origin xyz="0 0 0.5"/><mass value="{mass}"/>
  <inertia ixx="{ixx}" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="{izz}"/></inertial>"""


def text(
    mass: str = "2", ixx: str = "0.1", izz: str = "0.01", link: str = "", joint: str = "",
    axis: str = "0 1 0", kind: str = "revolute", visual: str = "",
) -> str:  # fmt: skip
    return f"""<robot name="pendulum"><link name="wall">{visual}</link><link name="rod">
      {INERTIAL.format(mass=mass, ixx=ixx, izz=izz)}</link>{link}
      <joint name="pivot" type="{kind}"><parent link="wall"/><child link="rod"/>
      <axis xyz="{axis}"/></joint>{joint}</robot>"""


def joint(name: str, parent: str, child: str, kind: str = "revolute") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="0 0 1"/></joint>'


def test_a_link_without_inertia_is_a_mass_in_one_point() -> None:
    robot = parse(text(ixx="0", izz="0").replace('iyy="0.1"', 'iyy="0"'), "rod.urdf")
    assert robot.links["rod"].mass == 2.0 and not robot.links["rod"].inertia.any()
    assert "link 'rod' has no inertia: taken as a mass in one point" in robot.notes[0]


BROKEN = {
    "zero mass": (text(mass="0"), "link 'rod' has mass 0 kg"),
    "negative mass": (text(mass="-1"), "link 'rod' has mass -1 kg"),
    "text as mass": (text(mass="heavy"), "link 'rod': expected 1 finite number"),
    "infinite mass": (text(mass="inf"), "link 'rod': expected 1 finite number"),
    "zero inertia": (text(izz="0"), "link 'rod' has an inertia with principal values"),
    "negative inertia": (text(ixx="-0.1"), "link 'rod' has an inertia with principal values"),
    "no axis": (text(axis="0 0 0"), "joint 'pivot' has the axis"),
    "planar joint": (text(kind="planar"), "joint 'pivot' is 'planar'"),
    "two links of a name": (text(link='<link name="rod"/>'), "link 'rod' occurs 2 times"),
    "two masses": (text().replace("<mass", '<mass value="9"/><mass', 1), "expected one <mass> in"),
    "absent link": (text(joint=joint("far", "rod", "moon")), "joint 'far' names link 'moon'"),
    "two carriers": (text(joint=joint("again", "wall", "rod")), "link 'rod' is carried by two"),
    "two roots": (text(link='<link name="loose"/>'), "expected one root link, got wall, loose"),
    "loop": (
        text(
            link='<link name="a"/><link name="b"/>',
            joint=joint("f", "a", "b") + joint("g", "b", "a"),
        ),
        "form a loop",
    ),
    "everything in a loop": (text(joint=joint("back", "rod", "wall")), "form a loop"),
    "no robot": ("<model/>", "expected a <robot> element"),
    "no XML": ("robot", "expected plain XML"),
    "entities": (
        '<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>',
        "expected plain XML without entities",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_what_no_machine_can_be_is_refused_by_name(case: str) -> None:
    content, message = BROKEN[case]
    with pytest.raises(ModelError) as caught:
        parse(content, "arm.urdf")
    assert str(caught.value).startswith("arm.urdf")
    assert message in str(caught.value)


def test_meshes_are_not_read_and_it_is_said() -> None:
    mesh = (
        '<visual><geometry><mesh filename="package://a/../../../secret.dae"/></geometry></visual>'
    )
    robot = parse(text(visual=mesh))
    assert "not read" in robot.notes[0] and "secret.dae" in robot.notes[0]
    assert parse(text()).notes == ()


def test_a_moving_link_without_mass_is_a_flange_at_the_end_else_unknown() -> None:
    """A flange is often a mere frame that turns."""
    last = text(link='<link name="tip"/>', joint=joint("free", "rod", "tip"))
    chain = serial(parse(last))
    assert not chain.inertia[10:].any() and chain.inertia[0] > 0.0
    assert chain.notes == (
        "link 'tip' moves and has no mass: taken as zero, as it is the last one",
    )
    hand = f'<link name="hand">{INERTIAL.format(mass="1", ixx="0.1", izz="0.1")}</link>'
    carries = last.replace("</robot>", hand + joint("wrist", "tip", "hand") + "</robot>")
    unknown = serial(parse(carries))
    assert unknown.undescribed == ("tip",) and "without a mass, so unknown: tip" in unknown.notes[0]
    glued = last.replace("</robot>", hand + joint("glue", "tip", "hand", "fixed") + "</robot>")
    assert serial(parse(glued)).notes == ()


def test_a_branch_asks_for_the_tip() -> None:
    other = f'<link name="arm2">{INERTIAL.format(mass="1", ixx="0.1", izz="0.1")}</link>'
    robot = parse(text(link=other, joint=joint("second", "wall", "arm2")))
    with pytest.raises(ModelError, match="branches into pivot, second: name the tip"):
        serial(robot)
    assert serial(robot, tip="arm2").joints == ("second",)
    with pytest.raises(ModelError, match="no link 'hand'"):
        serial(robot, tip="hand")


def test_fixed_links_join_their_carrier() -> None:
    weight = f'<link name="weight">{INERTIAL.format(mass="3", ixx="0.1", izz="0.1")}</link>'
    fixed = joint("glue", "rod", "weight", "fixed")
    chain = serial(parse(text(link=weight, joint=fixed)))
    assert chain.inertia[0] == 5.0
    assert chain.links == ("rod",)


def test_too_long_or_absent_files(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="at most"):
        parse(" " * 8_000_001)
    with pytest.raises(ModelError, match=r"gone.urdf: expected a readable"):
        read(tmp_path / "gone.urdf")


def test_a_file_is_an_arm(tmp_path: Path) -> None:
    path = tmp_path / "rod.urdf"
    path.write_text(text(), encoding="utf-8")
    arm = Arm.of(path)
    u = np.array([[np.pi / 2, 0.0, 0.0]])
    _, tau = arm.simulate(np.zeros(0), u, np.zeros(1), arm.parameters.values)
    assert tau[0, 0] == pytest.approx(-2.0 * 9.81 * 0.5)


def test_a_message_names_the_line() -> None:
    with pytest.raises(ModelError, match=r"^arm\.urdf:2: link 'rod' has mass -1 kg"):
        parse(text(mass="-1"), "arm.urdf")
    with pytest.raises(ModelError, match=r"^arm\.urdf:4: joint 'pivot' is 'planar'"):
        parse(text(kind="planar"), "arm.urdf")
    with pytest.raises(ModelError, match=r"^arm\.urdf:5: joint 'back' .*|.*form a loop: cut it"):
        parse(text(joint="\n" + joint("back", "rod", "wall")), "arm.urdf")


@pytest.mark.parametrize(
    "name", ["package://a/../../etc/passwd", "/etc/passwd", "file:///etc/passwd", "..\\up.stl"]
)
def test_a_mesh_outside_its_package_is_told_and_never_opened(name: str) -> None:
    mesh = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    notes = parse(text(visual=mesh), "arm.urdf").notes
    assert notes[1].startswith("arm.urdf:1: <mesh> names") and "not opened" in notes[1]


def test_moments_that_no_body_has_are_told() -> None:
    (note,) = parse(text(izz="0.5"), "arm.urdf").notes
    assert note.startswith("arm.urdf:2: link 'rod' has principal moments 0.1, 0.1, 0.5 kg m²")
