"""Messages that were printed to a table without headings, as ``ros2 topic echo --csv`` does.

The stamp's seconds and nanoseconds and the frame come first, then the message's members in the
order of its definition. Which message it is, only the number of columns tells, where it does.

>>> fitting("nntnnnnnnn")
['geometry_msgs/PoseStamped']
>>> heading("geometry_msgs/PointStamped")
'header.stamp.sec,header.stamp.nanosec,header.frame_id,point.x,point.y,point.z'
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evertwin.sources.texts.text import TextTable

_MESSAGES = {
    "geometry_msgs/PointStamped": "point:xyz",
    "geometry_msgs/Vector3Stamped": "vector:xyz",
    "geometry_msgs/QuaternionStamped": "quaternion:xyzw",
    "geometry_msgs/PoseStamped": "pose.position:xyz pose.orientation:xyzw",
    "geometry_msgs/TwistStamped": "twist.linear:xyz twist.angular:xyz",
    "geometry_msgs/AccelStamped": "accel.linear:xyz accel.angular:xyz",
    "geometry_msgs/WrenchStamped": "wrench.force:xyz wrench.torque:xyz",
    "geometry_msgs/TransformStamped": "child_frame_id transform.translation:xyz "
    "transform.rotation:xyzw",
    "geometry_msgs/PoseWithCovarianceStamped": "pose.pose.position:xyz pose.pose.orientation:xyzw "
    "pose.covariance:36",
    "geometry_msgs/TwistWithCovarianceStamped": "twist.twist.linear:xyz twist.twist.angular:xyz "
    "twist.covariance:36",
    "nav_msgs/Odometry": "child_frame_id pose.pose.position:xyz pose.pose.orientation:xyzw "
    "pose.covariance:36 twist.twist.linear:xyz twist.twist.angular:xyz twist.covariance:36",
    "sensor_msgs/Imu": "orientation:xyzw orientation_covariance:9 angular_velocity:xyz "
    "angular_velocity_covariance:9 linear_acceleration:xyz linear_acceleration_covariance:9",
    "sensor_msgs/MagneticField": "magnetic_field:xyz magnetic_field_covariance:9",
    "sensor_msgs/NavSatFix": "status.status status.service latitude longitude altitude "
    "position_covariance:9 position_covariance_type",
    "sensor_msgs/Range": "radiation_type field_of_view min_range max_range range",
    "sensor_msgs/Temperature": "temperature variance",
    "sensor_msgs/FluidPressure": "fluid_pressure variance",
    "ackermann_msgs/AckermannDriveStamped": "drive.steering_angle drive.steering_angle_velocity "
    "drive.speed drive.acceleration drive.jerk",
}
"""Message → its members behind the header, those of three axes, a turn or a matrix in one word."""
_HEADER = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")
_EARLIEST = 1e8
"""Seconds since 1970 of no stamp before."""


def _members(message: str) -> Iterator[str]:
    yield from _HEADER
    for word in _MESSAGES[message].split():
        stem, _, many = word.partition(":")
        each = range(int(many)) if many.isdigit() else many
        yield from (f"{stem}.{one}" for one in each) if many else (stem,)


def heading(message: str) -> str:
    """The line of headings that its table lacks."""
    return ",".join(_members(message))


def fitting(kinds: str) -> list[str]:
    """Messages with so many columns, texts where theirs are.

    Args:
        kinds: one letter a column, see `Dialect`.
    """
    out = []
    for message in _MESSAGES:
        names = list(_members(message))
        texts = [kind in "t?" if name.endswith("frame_id") else kind != "t"
                 for name, kind in zip(names, kinds, strict=False)]  # fmt: skip
        if len(names) == len(kinds) and all(texts):
            out.append(message)
    return out


def echoed(table: TextTable) -> str:
    """What to do about a table of messages without headings; empty where it is none."""
    dialect = table.dialect
    if dialect.headings.names or dialect.kinds[:2] != "nn" or dialect.kinds[2:3] not in ("t", "?"):
        return ""
    first, second = (column.name for column in table.columns[:2])
    rows = next(iter(table.rows([first, second], None, strict=False)), None)
    if rows is None or not len(rows.values):
        return ""
    seconds, nanos = rows.values[:1000].T
    whole = np.all(np.floor(rows.values[:1000]) == rows.values[:1000])
    if not (whole and seconds.min() > _EARLIEST and nanos.min() >= 0.0 and nanos.max() < 1e9):
        return ""
    fits, count = fitting(dialect.kinds), len(dialect.kinds)
    said = (
        f"no headings: a stamp, a frame and {count - 3} members, as `ros2 topic echo --csv` prints"
    )
    if len(fits) == 1:
        return f"{said} {fits[0]}: put this in the first line: {heading(fits[0])}"
    which = f" ({' or '.join(fits)} have as many)" if fits else ""
    return (
        f"{said} a message{which}: put the names of its members in the first line "
        f"({','.join(_HEADER)},…), or give the bag itself"
    )
