"""How widely a simulation is drawn until it holds the machine."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from evertwin.ahead.widening import Widening, widened
from evertwin.app.cli import main
from evertwin.errors import DataError
from planted.carts import cart
from planted.twins import opened


def of(seed: int, **wrong: float) -> Widening:
    with opened("robot1d") as twin:
        return widened(twin.prospect().basis, cart(np.random.default_rng(seed), **wrong))


def share(found: Widening, width: float) -> float:
    return next(one.share for one in found.held if one.width == width)


def test_a_machine_as_it_is_known_needs_no_width_and_more_costs() -> None:
    found = of(1)
    assert found.width == 0.0 and share(found, 0.0) > 0.92
    costs = [one.cost for one in found.held]
    assert costs[0] == 1.0 and costs[-1] > 3.0


def test_what_is_not_known_is_covered_by_as_little_as_does() -> None:
    for wrong in ({"gain": 0.9}, {"lag": 0.4}):
        found = of(2, **wrong)
        assert found.width > 0 and share(found, 0.0) < 0.9 < share(found, found.width)


def test_another_form_is_said_to_be_none_of_numbers() -> None:
    found = of(3, dead=0.08)
    assert not found.found and "No width holds the machine" in str(found)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = cart(np.random.default_rng(3), dead=0.08)
    table = np.column_stack([rows["t"], 100 * rows["v"], 100 * rows["x"]])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,v_cmd,x", comments="")
    with pytest.raises(SystemExit) as ended:
        main(["randomise", "twins/robot1d.toml", "--data", str(tmp_path / "run.csv"), "--json",
              "--check"])  # fmt: skip
    content = json.loads(capsys.readouterr().out)
    assert ended.value.code == 1 and content["width"] is None
    assert {one["output"] for one in content["held"]} == {"x"}
    few = {name: column[:20] for name, column in rows.items()}
    with opened("robot1d") as twin, pytest.raises(DataError, match="60 measured rows or more"):
        widened(twin.prospect().basis, few)
