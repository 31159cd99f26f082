"""``evertwin info`` of a TOML file: what a twin file says, or which command takes it."""

from __future__ import annotations

from pathlib import Path

from .conftest import Command


def test_info_of_a_twin_file_says_what_it_holds(call: Command, folder: Path) -> None:
    done = call("info", "robot.toml")
    assert done.code == 0 and len(done.out.splitlines()) == 5
    for part in ("twin robot, model robot1d", "time t [s]; v = v [cm/s], x = x [cm]",
                 "requirement 0.5 cm, predictions of 1 s", "kept: robot.db",
                 "next: evertwin doctor robot.toml"):  # fmt: skip
        assert part in done.out, part
    (folder / "bare.toml").write_text('schema = 1\nname = "a"\n[model]\nkind = "thermal"\n')
    assert "requirement none" in call("info", "bare.toml").out
    text = '[anomaly]\nrequirement = "0.1 bar"\n'
    (folder / "bar.toml").write_text((folder / "bare.toml").read_text() + text)
    assert "requirement 0.1 bar" in call("info", "bar.toml").out


def test_a_toml_file_is_no_recording(call: Command, folder: Path) -> None:
    for words in (("init", "robot.toml"), ("run", "robot.toml", "--data", "robot.toml")):
        done = call(*words)
        assert done.code == 4 and "got a TOML file" in done.err and done.err.count("\n") == 1
    (folder / "site.toml").write_text('[[twin]]\nname = "a"\n')
    done = call("info", "site.toml")
    assert done.code == 2 and "evertwin doctor site.toml" in done.err
