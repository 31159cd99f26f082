"""Bodies behind a joint that stands stay as described: other joints' rows cannot tell them."""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from evertwin.fold import Windows, make_block
from evertwin.machines.arm import Arm
from evertwin.refit.rows.standing_joints import without_standing

ARM = Arm.of(str(files("evertwin.machines").joinpath("data", "ur5_like.urdf")))


def moved(*joints: int) -> Windows:
    """A window in which these joints move, from 1 on."""
    u = np.zeros((50, len(ARM.inputs)))
    for j in joints:
        u[10:, ARM.inputs.names.index(f"qd{j}")] = 0.3
    return (make_block(t=np.arange(50) * 10**7, u=u, y=np.zeros((50, len(ARM.outputs)))),)


def test_bodies_of_what_stands_are_not_tuned() -> None:
    names = ("Fc2", "Fc3", *(f"{link}.mx" for link in ARM.chain.links))
    found = without_standing(ARM, names, moved(1, 2, 4, 5, 6))
    assert set(names) - set(found) == {f"{ARM.chain.links[2]}.mx"}


def test_one_that_moves_in_any_window_tells_its_own() -> None:
    names = tuple(f"{link}.mx" for link in ARM.chain.links)
    windows = (*moved(1, 2, 4, 5, 6), *moved(3))
    assert without_standing(ARM, names, windows) == names
