"""Which mobile base a recording is of, and what only the user knows of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.errors import ConfigError
from evertwin.machines.mobile import Omni
from evertwin.sources.columns.cells import Cell
from evertwin.sources.recorded import Recorded
from planted.draws import first_of

ROWS, STEP = 1200, 0.1


def driven(seed: int, side: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Commands ahead, to the left and of turning; the pose that a base makes of them."""
    rng = np.random.default_rng(seed)
    u = np.column_stack([
        np.repeat(rng.uniform(-0.2, 0.8, ROWS // 40), 40),
        side * np.repeat(rng.uniform(-0.5, 0.5, ROWS // 40), 40),
        np.repeat(rng.uniform(-0.5, 0.5, ROWS // 30), 30),
    ])  # fmt: skip
    base = Omni()
    p = base.parameters.values
    start = np.array([3.0, 4.0, rng.uniform(-3.0, 3.0)])
    _, pose = base.simulate(start, u, np.full(ROWS, STEP), p)
    return u, pose + rng.normal(0.0, [0.01, 0.01, 0.005], (ROWS, 3))


def written(folder: Path, heading: str, columns: list[np.ndarray], digits: int = 5) -> Path:
    table = np.column_stack([STEP * np.arange(ROWS), *columns])
    file = folder / "base.csv"
    np.savetxt(file, table, f"%.{digits}f", ",", header=heading, comments="")
    return file


def proposed(file: Path, kind: str = "") -> Path:
    out = file.with_suffix(".toml")
    write_starter([file], out, (kind, None), True, False)
    return out


@pytest.mark.parametrize(
    ("heading", "side", "kind"),
    [
        ("t,vx_set,vy_set,wz_set,x,y,phi", 1.0, "omni"),
        ("t,cmd_vel.linear.x,cmd_vel.linear.y,cmd_vel.angular.z,pose.x,pose.y,pose.theta", 1, "omni"),  # noqa: E501
        ("t,vx,vy,wz,x,y,yaw", 1.0, "omni"),
        ("t,vx,vy,wz,x,y,yaw", 0.02, "differential"),  # what it slips
        ("t,cmd_v,imu_vy,cmd_w,x,y,yaw", 1.0, "differential"),
        ("t,cmd_vel.linear.x,cmd_vel.linear.y,cmd_vel.angular.z,x,y,theta", 0.0, "differential"),
    ],
)  # fmt: skip
@first_of("seed", [1, 2])
def test_a_lateral_command_tells_an_omnidirectional_base(
    heading: str, side: float, kind: str, seed: int, tmp_path: Path
) -> None:
    u, pose = driven(seed, side)
    spec = read(proposed(written(tmp_path, heading, [u, pose])))
    assert spec.model.kind == kind
    if kind == "omni":
        names = heading.split(",")
        found = {name: c.column for name, c in spec.source[0].channels.items()}
        assert found == dict(zip(("vx", "vy", "w", "x", "y", "heading"), names[1:]))


@pytest.mark.parametrize(
    ("heading", "kind"),
    [
        ("t_s,drive_speed_mps,steer_angle_deg,pos_x_m,pos_y_m,theta_rad", ""),
        ("t_s,v_mps,steering_deg,x_m,y_m,heading_rad", ""),
        ("t,v,steering,x,y,yaw", "bicycle"),
    ],
)
def test_a_steered_base_is_asked_for_its_axles(heading: str, kind: str, tmp_path: Path) -> None:
    u, pose = driven(3)
    file = written(tmp_path, heading, [u[:, 0], np.degrees(u[:, 2]), pose])
    out = proposed(file, kind)
    text = out.read_text()
    assert 'kind = "bicycle"' in text
    with pytest.raises(ConfigError, match=r"\.toml:\d+: .*wheel_base: a question"):
        read(out)
    out.write_text(text.replace('"?", front', "1.4, front").replace('drive = "?"', "drive = true"))
    assert dict(read(out).model.options) == {"wheel_base": 1.4, "front_drive": True}


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("how", ["compass", "left", "unclear"])
def test_a_heading_over_north_is_told_by_the_way(how: str, seed: int, tmp_path: Path) -> None:
    u, pose = driven(seed)
    if how == "unclear":  # it drives straight on
        u, pose = u.copy(), pose.copy()
        pose[:, 0] = 3.0 + STEP * np.cumsum(u[:, 0])
        pose[:, 1], pose[:, 2] = 4.0 + pose[:, 0], 0.25 * np.pi
        pose[:, 2] += np.random.default_rng(seed).normal(0.0, 0.01, ROWS)
    yaw = np.degrees(pose[:, 2])
    shown = (90.0 - yaw if how == "compass" else yaw) % 360.0
    place = pose[:, :2] + [412_345.0, 5_412_345.0]
    heading = (
        "t,throttle_cmd_mps,turn_cmd_radps,gyro_z_degps,utm_easting_m,utm_northing_m,heading_deg"
    )
    file = written(tmp_path, heading, [u[:, 0], u[:, 2], u[:, 2], place, shown])
    out = proposed(file, "differential")
    if how == "unclear":
        assert 'scale = "?"' in out.read_text()
        return
    spec = read(out)
    found = spec.source[0].channels
    assert (found["x"].column, found["x"].unit) == ("utm_easting_m", "m")
    assert (found["v"].column, found["w"].column) == ("throttle_cmd_mps", "turn_cmd_radps")
    wanted = (-1.0, 90.0) if how == "compass" else (1.0, 0.0)
    assert (found["heading"].scale, found["heading"].offset) == wanted
    cells = (Cell("heading", "heading_deg", "deg", *wanted),)
    (chunk,) = Recorded("log", (file,), cells).read()
    np.testing.assert_allclose(np.exp(1j * chunk.v[:, 0]), np.exp(1j * pose[:, 2]), atol=1e-5)


def test_a_compass_says_it_by_its_name(tmp_path: Path) -> None:
    u, pose = driven(1)
    heading = "t,cmd_v,cmd_w,easting,northing,compass_rad"
    file = written(tmp_path, heading, [u[:, 0], u[:, 2], pose[:, :2] * [1, 1], 1.5708 - pose[:, 2]])
    found = read(proposed(file)).source[0].channels["heading"]
    assert (found.column, found.scale, found.offset) == ("compass_rad", -1.0, 1.570796)


@pytest.mark.parametrize("at", [(48.853, 8.604), (-33.86, 151.21), (69.65, -18.96)])
def test_fixes_are_read_on_a_plane(
    at: tuple[float, float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    u, pose = driven(2)
    east, north = pose[:, 0], pose[:, 1]
    # radii of curvature of the ellipsoid
    a, e2 = 6_378_137.0, 0.00669437999014
    s = np.sin(np.radians(at[0]))
    meridian, across = a * (1 - e2) / (1 - e2 * s * s) ** 1.5, a / np.sqrt(1 - e2 * s * s)
    lat = at[0] + np.degrees(north / meridian)
    lon = at[1] + np.degrees(east / across / np.cos(np.radians(at[0])))
    lat[7] = lon[7] = 0.0  # no fix
    compass = (90.0 - np.degrees(pose[:, 2])) % 360.0
    heading = "t,cmd_vel_linear_x,cmd_vel_angular_z,gps.latitude,gps.longitude,heading_deg"
    file = written(tmp_path, heading, [u[:, 0], u[:, 2], lat, lon, compass], 9)
    spec = read(proposed(file))
    said = capsys.readouterr().err
    assert "gps.latitude, gps.longitude: read as gps.east, gps.north [m] from" in said
    assert f"from {at[0]:.2f}".rstrip("0") in said
    found = {name: (c.column, c.unit) for name, c in spec.source[0].channels.items()}
    assert found["x"] == ("gps.east", "m") and found["y"] == ("gps.north", "m")
    cells = (Cell("x", "gps.east", "m"), Cell("y", "gps.north", "m"))
    (chunk,) = Recorded("log", (file,), cells).read()
    assert np.isnan(chunk.v[7]).all()
    got, rest = np.delete(chunk.v, 7, axis=0), np.delete(pose[:, :2], 7, axis=0)
    np.testing.assert_allclose(got - got[0], rest - rest[0], atol=5e-3)


def test_what_is_no_fix_adds_no_plane(tmp_path: Path) -> None:
    u, pose = driven(2)
    heading = "t,cmd_v,cmd_w,acc_lat,acc_long,x,y,yaw"
    file = written(tmp_path, heading, [u[:, 0], u[:, 2], u[:, ::2], pose])
    assert "east" not in proposed(file).read_text()


@pytest.mark.parametrize("first", ["odom", "map"])
def test_a_pose_is_of_one_table_where_two_tell_it_in_two_frames(first: str, tmp_path: Path) -> None:
    """The wheels say heading by its name, the map of a lidar theta: x and y must not be mixed."""
    u, pose = driven(3)
    t = (STEP * 1e9 * np.arange(ROWS)).astype(np.int64)
    tables = {
        "odom": ("t_ns,v,w,pos.x,pos.y,orientation.yaw", [u[:, [0, 2]], pose - pose[0]]),
        "map": ("t_ns,x,y,theta,var_x,var_theta", [pose, 1e-5 * (1 + pose[:, :2] ** 2)]),
    }
    files = []
    for name in sorted(tables, key=lambda name: name != first):
        heading, columns = tables[name]
        file = tmp_path / f"{name}.csv"
        table = np.column_stack([t, *columns])
        np.savetxt(file, table, "%.7f", ",", header=heading, comments="")
        files.append(file)
    out = tmp_path / "twin.toml"
    write_starter(files, out, ("differential", None), True, False)
    held = [set(re.findall(r"^(x|y|heading) = ", part, re.M))
            for part in out.read_text().split("[[source]]")]  # fmt: skip
    assert {"x", "y", "heading"} in held and sum(map(len, held)) == 3


@pytest.mark.parametrize(
    ("left", "right", "asked"),
    [
        ("cmd_left", "cmd_right", False),
        ("left track [rad/s]", "right track [rad/s]", True),
        ("wheel_left_vel", "wheel_right_vel", True),
        ("v_left [m/s]", "v_right [m/s]", True),
        ("Kette links [rad/s]", "Kette rechts [rad/s]", True),
        ("left_rpm", "right_rpm", True),
        ("left wheel speed command [rad/s]", "right wheel speed command [rad/s]", False),
    ],
)
def test_two_wheels_and_a_pose_are_a_base_that_is_asked_for_its_wheels(
    left: str, right: str, asked: bool, tmp_path: Path
) -> None:
    u, pose = driven(1)
    wheels = [(u[:, 0] + sign * 0.2 * u[:, 2]) / 0.1 for sign in (-1.0, 1.0)]
    out = proposed(written(tmp_path, f"t,{left},{right},x,y,yaw", [*wheels, pose]))
    text = out.read_text()
    assert 'kind = "differential"' in text
    assert ("no name says whether it is told or measured" in text) == asked
    assert "distance of the two" in text
    with pytest.raises(ConfigError, match="a question that was left open"):
        read(out)


def test_what_wheels_were_measured_to_do_is_no_command(tmp_path: Path) -> None:
    u, pose = driven(1)
    wheels = [(u[:, 0] + sign * 0.2 * u[:, 2]) / 0.1 for sign in (-1.0, 1.0)]
    out = proposed(written(tmp_path, "t,left_wheel_actual,encoder_right,x,y,yaw", [*wheels, pose]))
    assert 'kind = "differential"' not in out.read_text()
