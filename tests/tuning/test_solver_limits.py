"""Numbers beyond reckoning."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.fold import make_block
from evertwin.machines.arm import Arm
from evertwin.tuning import Problem, solve


def test_an_input_that_no_machine_reaches_is_named_and_nothing_breaks() -> None:
    rng = np.random.default_rng(0)
    arm = Arm.of("ur5_like", "sign", payload=True)
    u, y = rng.normal(size=(200, 18)), rng.normal(size=(200, 6))
    u[17, 7] = -3e96
    rows = make_block(t=np.arange(200) * 10**7, u=u, y=y)
    with pytest.raises(DataError, match=r"qd2 is 3e\+96 rad/s in row 17 .*no machine reaches"):
        solve(Problem(arm, (rows,), ("payload.m", "payload.mx"), np.inf))
