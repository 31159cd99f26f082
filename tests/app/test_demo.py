"""Both embedded machines record in processes of their own, and both twins improve themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import Command


@pytest.mark.slow
def test_both_twins_improve(call: Command, folder: Path) -> None:
    done = call("demo", "--out", "shown", "--json")
    assert done.code == 0, done.err
    content = done.json
    assert content["schema"] == "evertwin.demo/1"
    robot, arm = content["robot"], content["arm"]
    updates = robot["position_updates"]
    assert updates["before"] >= 3 * updates["after"] > 0
    assert {term["kind"] for term in robot["champion"]["terms"]}
    for axis in range(1, 7):
        figures = arm["outputs"][f"tau{axis}"]
        assert figures["relative_rms_moving_before"] > 0.1
        assert figures["relative_rms_moving_after"] < 0.05
    for name in ("robot", "arm"):
        assert any(event["kind"] == "promoted" for event in content[name]["events"])
        page = (folder / "shown" / f"{name}.html").read_text()
        assert "<svg" in page or "data:image/png" in page
        assert "http://" not in page.replace("http://www.w3.org", "") and "<script src" not in page
