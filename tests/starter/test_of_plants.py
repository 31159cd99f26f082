"""What is proposed for exports of plants, where words and counters could mislead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evertwin.app.first.init_command import Said, write_starter
from evertwin.machines.catalog import machine
from evertwin.starter import Proposal, Seen, kind_of, look, mapped
from evertwin.starter.answers import answers_of, with_rates
from evertwin.starter.proposal import ASK

N = 600
RNG = np.random.default_rng(8)
SET = np.repeat(RNG.uniform(0.0, 100.0, N // 30), 30)
SLOW = np.convolve(SET, np.exp(-np.arange(200) / 40.0) / 40.0)[:N]


def seen_of(folder: Path, head: str, *columns: Sequence[float] | np.ndarray) -> tuple[Seen, ...]:
    rows = (",".join(f"{v:.8g}" for v in row) for row in zip(*columns, strict=True))
    file = folder / "log.csv"
    file.write_text("\n".join((head, *rows, "")), encoding="utf-8")
    return look([file])[0]


def fed(found: Proposal) -> dict[str, str]:
    return {match.channel: match.column for match in found.matches}


T = 10.0 * np.arange(N) + 0.5


def test_what_is_heated_is_what_the_room_is_not(tmp_path: Path) -> None:
    air = 19.0 + np.sin(T / 900.0)
    head = "time [s],O1.TT101.PV [°C],O1.HTR.OUT [%],O1.TT102.AMB [°C],O1.SP [°C]"
    seen = seen_of(tmp_path, head, T, 20.0 + SLOW, SET, air, np.full(N, 180.0))
    assert kind_of(seen) == "thermal"
    found = fed(mapped(machine("thermal", {}), seen))
    assert found == {"heater": "O1.HTR.OUT", "box": "O1.TT101.PV", "room": "O1.TT102.AMB"}


def test_of_two_alike_none_is_taken_to_be_heated(tmp_path: Path) -> None:
    head = "time [s],heater [%],T-1.PV [°C],T-2.PV [°C]"
    seen = seen_of(tmp_path, head, T, SET, 20.0 + SLOW, 30.0 + SLOW)
    found = mapped(machine("thermal", {}), seen)
    assert "box" in found.missing or fed(found)["box"] == ASK


def test_what_answers_is_not_asked_to_drive(tmp_path: Path) -> None:
    head = "time [s],Niveau T-401 [cm],Zufluss [l/min],Ablass offen [%]"
    other = SET[::-1]
    seen = seen_of(tmp_path, head, T, SLOW, SET, other)
    u, y = mapped(None, seen).matches
    assert (u.column, y.column) == (ASK, "Niveau T-401")
    assert u.reason == "which one drives? Zufluss; Ablass offen"


def test_the_place_of_a_valve_drives(tmp_path: Path) -> None:
    head = "time [s],Füllstand,Ventilstellung V7,Mediumtemperatur [°C]"
    seen = seen_of(tmp_path, head, T, SLOW, SET, 20.0 + RNG.normal(0.0, 0.1, N))
    assert fed(mapped(None, seen))["u"] == "Ventilstellung V7"


def test_a_counter_asks_for_the_rate_and_feeds_nothing(tmp_path: Path) -> None:
    (one,) = seen_of(tmp_path, "k,pump,level", np.arange(N), SET, SLOW)
    assert one.period is None and [c.name for c in one.columns] == ["pump", "level"]
    (told,) = with_rates((one,), answers_of(["log.rate=20 Hz"]))
    assert told == replace(one, every=0.05) and told.period == 0.05


def test_experiments_behind_one_another_are_tasks(tmp_path: Path) -> None:
    run, t = np.divmod(np.arange(N), 200)
    (one,) = seen_of(tmp_path, "run,t [s],u,y", 7 - run, 0.1 * t, SET, SLOW)
    assert one.task == "run"
    (one,) = seen_of(tmp_path, "run,step,u,y", run, t, SET, SLOW)
    assert one.task == "run"
    out = tmp_path / "log.toml"
    write_starter([tmp_path / "log.csv"], out, ("", None), force=True, as_json=False,
                  said=Said(answers=["log.rate=10 Hz"]))  # fmt: skip
    assert 'task = "run"' in out.read_text()
    (one,) = seen_of(tmp_path, "valve,t [s],u,y", SET // 50, 0.1 * np.arange(N), SET, SLOW)
    assert one.task == ""
