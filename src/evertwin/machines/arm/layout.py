"""What the numbers of an arm are called, and where its kernel finds them.

>>> from evertwin.machines.arm.inertia import NAMES
>>> payload_parameters()[0].name, len(NAMES)
('payload.m', 10)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from evertwin.machines.arm import inertia
from evertwin.machines.arm.chain import Chain
from evertwin.machines.arm.coupling import Coupling
from evertwin.machines.arm.kernel import DRIVE, HEAD
from evertwin.machines.arm.rnea import BODY
from evertwin.machines.arm.shafts import Shaft
from evertwin.machines.friction import Law
from evertwin.machines.friction.kernel import columns_of, record_of
from evertwin.models import Parameter, Parameters
from evertwin.signals import Channel, Layout
from evertwin.types import Float64, Int64

_SLACK = 1.05
"""How far a recording may pass the limits of the description before it cannot be true."""


def inputs_of(chain: Chain, motors: bool = False) -> Layout:
    """Positions q1…, velocities qd1…, accelerations qdd1…; limits where they are the joints'."""
    channels: list[Channel] = []
    for order, name in enumerate(("q", "qd", "qdd")):
        for j in range(chain.n):
            unit = ("m" if chain.sliding[j] else "rad") + ("", "/s", "/s**2")[order]
            low, high, speed = chain.limits[j]
            if motors:
                channels.append(Channel(f"{name}{j + 1}", unit))
            elif order == 0 and low < high:
                channels.append(Channel(f"q{j + 1}", unit, low=low * _SLACK, high=high * _SLACK))
            elif order == 1:
                top = speed * _SLACK
                channels.append(Channel(f"qd{j + 1}", unit, low=-top, high=top))
            else:
                channels.append(Channel(f"{name}{j + 1}", unit))
    return Layout(tuple(channels))


def outputs_of(chain: Chain, current: bool) -> Layout:
    """Joint torques tau1… (forces where a joint slides) or motor currents i1…"""
    if current:
        return Layout(tuple(Channel(f"i{j + 1}", "A") for j in range(chain.n)))
    units = ["N" if slides else "Nm" for slides in chain.sliding]
    return Layout(tuple(Channel(f"tau{j + 1}", unit) for j, unit in enumerate(units)))


TOOL = 0.1
"""Part of the arm's mass and length that a tool may have."""


def drive_items(chain: Chain, laws: Sequence[Law], rotor: bool) -> list[Parameter]:
    """Rotor inertia and friction of every joint, from the base outwards.

    A rotor behind its gear weighs no more than the arm that it has to move.
    """
    items: list[Parameter] = []
    mass, _, second = (float(size) for size in hanging(chain)[0])
    for j, law in enumerate(laws):
        slides = chain.sliding[j]
        unit, most = ("kg", mass) if slides else ("kgm2", second)
        items += [Parameter(f"Ia{j + 1}", 0.0, unit, sigma=most)] if rotor else []
        items += law.parameters(str(j + 1), slides)
    return items


def base_items(chain: Chain, base: Sequence[int]) -> list[Parameter]:
    """The chosen inertial numbers, named after link and number, starting at the description: this
    may be off by the moments of all that hangs on the joint, which a number may stand for too."""
    items, most = [], hanging(chain)
    for flat in base:
        link, number = divmod(flat, BODY)
        name = f"{chain.links[link]}.{inertia.NAMES[number]}"
        value, sigma = float(chain.inertia[flat]), float(most[link, _ORDER[number]])
        unit = inertia.UNITS[number]
        items.append(Parameter(name, value, unit, sigma=sigma, source="description"))
    return items


_ORDER = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2)
"""Is a number of a body its mass, a first or a second moment?"""


def hanging(chain: Chain) -> Float64[np.ndarray, "ny 3"]:
    """Mass [kg], first [kg m] and second moment [kg m²] of all that hangs on each joint, stretched
    out, and of a tool of a tenth of the arm at a tenth of its length; infinite where nothing is
    described, or a link of it is not."""
    steps = chain.geometry[3:].reshape(-1, 13)[:, 9:12]
    travel = [
        max(map(abs, limits[:2])) if slides and np.isfinite(limits[:2]).all() else 0.0
        for limits, slides in zip(chain.limits, chain.sliding, strict=True)
    ]
    ahead = np.linalg.norm(steps, axis=1) + travel
    bodies = chain.inertia.reshape(-1, BODY)
    mass, arm = TOOL * float(bodies[:, 0].sum()), TOOL * float(ahead.sum())
    first, second = mass * arm, mass * arm**2
    out, known = np.full((chain.n, 3), np.inf), True
    for j in reversed(range(chain.n)):
        own, known = bodies[j], known and chain.links[j] not in chain.undescribed
        mass, first = mass + float(own[0]), first + float(np.linalg.norm(own[1:4]))
        second += float(own[4] + own[6] + own[9]) / 2
        if known and mass > 0.0:
            out[j] = mass, first, second
        # seen from one joint further in, all of it is further out
        second += 2.0 * ahead[j] * first + ahead[j] ** 2 * mass
        first += ahead[j] * mass
    return out


def payload_parameters() -> list[Parameter]:
    """Ten numbers of what the tip carries, in the tip's frame; the second moments are not tuned."""
    return [
        Parameter(f"payload.{name}", 0.0, unit, editable=False)
        for name, unit in zip(inertia.NAMES, inertia.UNITS, strict=True)
    ]


def payload_map(chain: Chain) -> Float64[np.ndarray, "10 10"]:
    """From the ten numbers in the tip's frame to those in the last link's."""
    turn, at = chain.tool[:3, :3], chain.tool[:3, 3]
    columns = [inertia.moved(unit, turn, at) for unit in np.eye(BODY)]
    return np.stack(columns, axis=1)


class Drives(NamedTuple):
    """Where the numbers of each joint's drive lie.

    >>> Drives._fields
    ('inertia', 'laws', 'terms')
    """

    inertia: tuple[int, ...]
    """Place in ``p`` of each rotor inertia; −1: none."""
    laws: tuple[Int64[np.ndarray, " k"], ...]
    """Record of each friction law (`evertwin.machines.friction.kernel`)."""
    terms: tuple[Int64[np.ndarray, "k 4"], ...]
    """Columns of each friction law."""


def drives_of(laws: Sequence[Law], names: tuple[str, ...]) -> Drives:
    """The drives of an arm whose parameters have these names."""
    rotors = [f"Ia{j + 1}" for j in range(len(laws))]
    first = [names.index(law.parameters(str(j + 1))[0].name) for j, law in enumerate(laws)]
    return Drives(
        tuple(names.index(rotor) if rotor in names else -1 for rotor in rotors),
        tuple(map(record_of, laws, first)),
        tuple(map(columns_of, laws, first)),
    )


def context_of(
    chain: Chain,
    base: Sequence[int],
    drives: Drives,
    parameters: Parameters,
    addresses: tuple[int, int, int],
    turning: tuple[Coupling | None, Sequence[Shaft]],
) -> Int64[np.ndarray, " k"]:
    """The kernel's integers, as `evertwin.machines.arm.kernel` reads them."""
    names, (coupling, shafts) = parameters.names, turning
    single = [names.index(n) if n in names else -1 for n in ("payload.m", "delay", "K1")]
    first = names.index(base_items(chain, base)[0].name) if base else 0
    pairs = [value for k, flat in enumerate(base) for value in (flat, first + k)]
    shared = int(not base and single[0] < 0)
    coupled = 0 if coupling is None else 2 if coupling.motors else 1
    head = [chain.n, *addresses, len(base), *single, shared, coupled, len(shafts)]
    for shaft in shafts:
        pairs += [shaft.axis, names.index(shaft.rung.add[0])]
    if len(head) != HEAD:
        raise AssertionError("arm: the context does not match its kernel")
    at, own = HEAD + DRIVE * chain.n + len(pairs), list[int]()
    for rotor, law in zip(drives.inertia, drives.laws, strict=True):
        own += [rotor, at]
        at += len(law)
    return np.array([*head, *own, *pairs, *np.concatenate(drives.laws)], dtype=np.int64)
