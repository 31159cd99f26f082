"""Both embedded machines record in processes of their own, and both twins improve themselves."""

from __future__ import annotations

import json
import subprocess
import sys
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


@pytest.mark.slow
def test_both_twins_run_beside_their_machines(tmp_path: Path) -> None:
    words = ["demo", "--live", "--headless", "--speed", "20", "--seconds", "4", "--json"]
    command = [sys.executable, "-m", "evertwin", *words]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    content = json.loads(done.stdout)
    assert content["schema"] == "evertwin.demo-live/1" and content["speed"] == 20.0
    assert {name: one["samples"] > 20 for name, one in content["twins"].items()} == {
        "arm_live": True, "robot_live": True,
    }  # fmt: skip
