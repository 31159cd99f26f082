"""The bases as models: channels, parameters with bounds, and which kernel moves them."""

from __future__ import annotations

from collections.abc import Sequence

from evertwin.errors import UsageError, nearest
from evertwin.machines.mobile import kernels
from evertwin.models import Compiled, Parameter, Parameters
from evertwin.signals import Channel, Layout

HEADING = Channel("heading", "rad", kind="angle", group="pose")
POSE = Layout((Channel("x", "m", group="pose"), Channel("y", "m", group="pose"), HEADING))


POINT = ("ahead", "aside")
"""Where the pose is measured, from a base's own point."""
OMNI = ("wheels", "wheel_radius", "wheel_distance", "gear", "odometry")
"""Options of an omnidirectional base besides."""


def _gain(name: str) -> Parameter:
    return Parameter(name, 1.0, "1", low=0.2, high=5.0, source="as commanded")


def _point(items: Sequence[Parameter], **sides: float) -> tuple[Parameters, tuple[int, int]]:
    """The numbers of a base with how far ``ahead`` of its own point, and ``aside`` to the left, its
    pose is measured, where it is; and their places."""
    given = [Parameter(n, value, "m", editable=False) for n, value in sides.items() if value]
    found = Parameters((*items, *given))
    names = found.names
    ahead, aside = (names.index(n) if n in names else 0 for n in POINT)
    return found, (ahead, aside)


def _motors(*names: str) -> Layout:
    return Layout(tuple(Channel(f"{name}{i}", "rad/s") for name in names for i in (1, 2, 3)))


class Robot1D(Compiled):
    """A robot on a line: commanded speed v [m/s] to position x [m], dx/dt = gain·v.

    The longitudinal reduction of Müller, Jazdi, Weyrich, "Self-improving Models for the Intelligent
    Digital Twin", section 4.

    >>> Robot1D().inputs.names, Robot1D().outputs.names, Robot1D().parameters.names
    (('v',), ('x',), ('gain',))
    """

    def __init__(self) -> None:
        line = Layout.of(x="m")
        super().__init__(
            Layout.of(v="m/s"), line, line, Parameters((_gain("gain"),)),
            kernels.travel_step, kernels.observe, (1,),
        )  # fmt: skip


class Differential(Compiled):
    """A differential base: forward speed v [m/s] and turn rate w [rad/s] to pose x, y, heading.

        dx/dt = gain·v·cos(heading),   dy/dt = gain·v·sin(heading),   d(heading)/dt = turn_gain·w

    The heading counts from the x axis, and like w positive to the left (seen from above); v is
    positive forwards.

    With ``wheels`` the inputs are the wheels' speeds ``left`` and ``right`` [rad/s] instead, and
    the parameters are ``wheel_radius`` r and ``wheel_base`` b [m]: v = r·(left + right)/2,
    w = r·(right − left)/b. On a skid-steered base b is an effective length, larger than the real
    one.

    ``ahead`` and ``aside`` [m] say how far before and to the left of the axle's middle the pose is
    measured (a marker, an antenna), on any base with a pose; each is a number where it is not 0.

    >>> Differential().inputs.names, Differential(wheels=True, wheel_radius=0.3).inputs.names
    (('v', 'w'), ('left', 'right'))
    """

    def __init__(
        self, wheels: bool = False, wheel_radius: float = 0.1, wheel_base: float = 0.5,
        ahead: float = 0.0, aside: float = 0.0,
    ) -> None:  # fmt: skip
        if min(wheel_radius, wheel_base) <= 0.0:
            raise UsageError(
                f"expected wheel_radius and wheel_base above 0 m, got {wheel_radius}, {wheel_base}"
            )
        step, observe = kernels.twist_step, kernels.observe
        inputs, items = Layout.of(v="m/s", w="rad/s"), (_gain("gain"), _gain("turn_gain"))
        if wheels:
            step, inputs = kernels.wheel_step, Layout.of(left="rad/s", right="rad/s")
            items = (
                Parameter("wheel_radius", wheel_radius, "m", 0.2 * wheel_radius, 5 * wheel_radius),
                Parameter("wheel_base", wheel_base, "m", 0.2 * wheel_base, 5 * wheel_base),
            )
        numbers, at = _point(items, ahead=ahead, aside=aside)
        super().__init__(inputs, POSE, POSE, numbers, step, observe, (3, *at))


class Bicycle(Compiled):
    """A steered base (a car, a forklift, a tricycle): speed v [m/s] and angle of its steered wheel
    [rad] to pose x, y, heading.

    The kinematic bicycle: the rear axle goes along the heading, which turns by v·tan(angle)/b. With
    ``front_drive`` the speed is that of the steered wheel, and the heading turns by v·sin(angle)/b.
    ``wheel_base`` b [m], and how far before and to the left of the rear axle's middle the pose is
    measured (``ahead``, ``aside`` [m]), come from the description. All can be tuned, b not beside
    the gain of the steering: small angles tell their ratio alone.

    >>> Bicycle(wheel_base=1.4).inputs.names, Bicycle().parameters.editable
    (('v', 'steering'), ('gain', 'steering_gain', 'steering_offset'))
    """

    def __init__(
        self, wheel_base: float = 1.0, ahead: float = 0.0, front_drive: bool = False,
        aside: float = 0.0,
    ) -> None:  # fmt: skip
        if not wheel_base > 0.0:
            raise UsageError(f"expected a wheel_base above 0 m, got {wheel_base}")
        reach = 5.0 * wheel_base
        items = (
            _gain("gain"), _gain("steering_gain"),
            Parameter("steering_offset", 0.0, "rad", -0.5, 0.5, source="as commanded"),
            Parameter("wheel_base", wheel_base, "m", 0.2 * wheel_base, reach, editable=False),
            Parameter("ahead", ahead, "m", -reach, reach, editable=False),
        )  # fmt: skip
        numbers, at = _point(items, aside=aside)
        super().__init__(
            Layout.of(v="m/s", steering="rad"), POSE, POSE, numbers,
            kernels.steered_step, kernels.observe, (3, *at, int(front_drive)),
        )  # fmt: skip


class Odometer(Compiled):
    """Forward speed v and turn rate w to the way travelled (signed, [m]) and the heading.

        d(travel)/dt = gain·v,   d(heading)/dt = turn_gain·w

    For recordings that know how far and how much a base turned, but not where it is.

    >>> Odometer().outputs.names
    ('travel', 'heading')
    """

    def __init__(self) -> None:
        way = Layout((Channel("travel", "m"), Channel("heading", "rad", kind="angle")))
        items = Parameters((_gain("gain"), _gain("turn_gain")))
        super().__init__(
            Layout.of(v="m/s", w="rad/s"), way, way, items, kernels.travel_step,
            kernels.observe, (2,),
        )  # fmt: skip


class Omni(Compiled):
    """An omnidirectional base: vx, vy [m/s] and turn rate w [rad/s] to pose x, y, heading.

    With ``wheels`` the inputs are the set speeds ``set1`` to ``set3`` [rad/s] of the motors of
    three omni wheels instead, 60°, 180° and 300° to the left of forward, and the outputs are the
    motors' speeds ``motor1`` to ``motor3`` as well: what the motors lose of a set speed and what
    the floor takes of the wheels' speed (the gains) are told apart. ``load`` [rad/s] is what the
    floor's resistance takes of the motors' speeds, each by its share of the way (Euclidean norm
    over the three). Sizes come from the description. With ``odometry`` the pose follows the
    measured motor speeds, further inputs ``wheel1`` to ``wheel3``, so that each loss is judged on
    rows of its own. ``ahead`` and ``aside`` [m] as of a differential base.

    >>> Omni().parameters.names, Omni(wheels=True).outputs.names
    (('gain', 'side_gain', 'turn_gain'), ('x', 'y', 'heading', 'motor1', 'motor2', 'motor3'))
    """

    def __init__(
        self, wheels: bool = False, wheel_radius: float = 0.04, wheel_distance: float = 0.125,
        gear: float = 1.0, odometry: bool = False, **point: float,
    ) -> None:  # fmt: skip
        for name in point.keys() - set(POINT):
            raise UsageError(f"omni: no option {name!r}, {nearest(name, (*OMNI, *POINT))}")
        sizes = (("wheel_radius", wheel_radius, "m"), ("wheel_distance", wheel_distance, "m"),
                 ("gear", gear, "1"))  # fmt: skip
        for name, value, unit in sizes:
            if value <= 0.0:
                raise UsageError(f"expected {name} above 0 {unit}, got {value}")
        items = [_gain("gain"), _gain("side_gain"), _gain("turn_gain")]
        step, inputs, outputs = kernels.omni_step, Layout.of(vx="m/s", vy="m/s", w="rad/s"), POSE
        if wheels:
            step = kernels.three_wheel_step
            inputs = _motors("set", *["wheel"] * odometry)
            outputs = Layout((*POSE.channels, *_motors("motor")))
            load = Parameter("load", 0.0, "rad/s", 0.0, 100.0, source="as commanded")
            items += [load, *(Parameter(*s, low=0.0, editable=False) for s in sizes)]
        numbers, at = _point(items, **point)
        super().__init__(
            inputs, outputs, POSE, numbers, step, kernels.observe, (3, *at, 3 * odometry)
        )
