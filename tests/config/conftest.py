"""A twin file that uses every form of setting."""

from __future__ import annotations

import pytest

FULL = (
    'schema = 1\nname = "robot"\nbeat = 50\n'
    '[model]\nkind = "differential"\noptions = { base = "30 cm", label = "r2", gears = [1, 2] }\n'
    '[model.parameters.gain]\nvalue = 100.0\nunit = "%"\nlow = "50 %"\nsigma = 10\n'
    "[model.parameters]\nslip = 0.1\n"
    '[[source]]\nname = "odometry"\ntime = "t"\nfiles = ["${ABSENT_FOLDER}/a.csv"]\n'
    '[source.channels]\nv = { column = 0, unit = "cm/s", sentinels = [-1, 9.5] }\n'
    '[[source]]\nname = "pose"\ntime = { rate = "10 Hz" }\nmatch = "*pose*"\nchannels = {}\n'
    "where = { mode = [1, 2] }\n"
    '[[derive]]\nname = "a"\nop = "derivative"\nfrom = ["v"]\n'
    '[signals]\nv = "v_cmd"\n[signals.heading]\nlow = "-180 deg"\nhigh = "180 deg"\n'
    '[clock]\nrate = "1 kHz"\ngap = "1 min"\n[clock.crop]\nchannels = ["v"]\nabove = "2 cm/s"\n'
    '[arbiter]\ngate = 3\ntolerance = "2 cm"\n[arbiter.groups.heading]\ntolerance = "1 deg"\n'
    '[prediction]\nhorizon = 2\n[anomaly]\nrequirement = "2 cm"\n[tuning.weights]\ngain = 2\n'
    "[tuning.causes]\nload = ['mass']\n"
)


@pytest.fixture(scope="session")
def full_text() -> str:
    return FULL
