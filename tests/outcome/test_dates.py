"""A date is told as the recording has it: with a zone only where it names one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evertwin.config.spec import ModelSpec, PredictionSpec, TwinSpec
from evertwin.fold import Event
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.twin import Twin

BEGIN = np.datetime64("2027-03-05T07:00:00")


@pytest.mark.parametrize(("zone", "said"), [("", "07:00:09 "), ("Z", "07:00:09Z")])
def test_a_local_time_carries_no_zone(zone: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    rows = [f"{BEGIN + np.timedelta64(k, 's')}{zone},0.2,{0.2 * k:.3f}" for k in range(60)]
    file.write_text("\n".join(["time,v,x", *rows, ""]))
    channels = {"v": ChannelSpec("v", "m/s"), "x": ChannelSpec("x", "m")}
    source = SourceSpec("log", channels, (str(file),), time=TimeSpec("time", "iso"))
    spec = TwinSpec("robot", ModelSpec("robot1d"), source=(source,),
                    prediction=PredictionSpec(horizon=1.0))  # fmt: skip
    with Twin(spec) as twin:
        run = twin.run()
    assert run.local == (zone == "")
    stamp = int((BEGIN + np.timedelta64(9, "s")).astype("datetime64[ns]").astype(np.int64))
    told = replace(run, events=(Event(9, stamp, "tuned", "x", "tuned gain", {}),))
    assert f"2027-03-05 {said}" in told.text(every=True)
