"""Traces of drives: effective currents, German compounds, a counter of rows, the clock's rate."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evertwin.app.first.init_command import write_starter
from evertwin.config import read
from evertwin.starter.looks.words import quantity, role, words


def _axis(seed: int, step: float, n: int = 3000) -> tuple[np.ndarray, ...]:
    r = np.random.default_rng(seed)
    t = step * np.arange(n)
    a, b, c = r.uniform(0.2, 1.0, 3)
    place = 0.5 + 0.3 * np.sin(a * t) + 0.1 * np.sin(3 * b * t + c)
    speed = 0.3 * a * np.cos(a * t) + 0.3 * b * np.cos(3 * b * t + c)
    current = 5.0 * np.sign(speed) + 9.0 * speed + r.normal(0.0, 0.05, n)
    return t, place, speed, current


@pytest.mark.parametrize(
    ("heads", "first", "step", "rate"),
    [
        ("Sample;Zeit [ms];Achse_X.ActualPosition [mm];Achse_X.ActualVelocity [mm/s];"
         "r78 Stromistwert momentenbildend [Aeff]", "Messung;Trace_Achse_X", 0.004, 250.0),
        ("Index;t [ms];Lageistwert [mm];Geschwindigkeitsistwert [mm/s];Stromistwert [Arms]",
         "Datei;7", 0.012, 83.3333),
        ("Nr;time [ms];ActPos [mm];ActVelo [mm/s];ActCurrent [A_rms]", "Trace;1", 0.001, 500.0),
    ],
)  # fmt: skip
def test_a_trace_of_a_drive_is_a_force_from_motion(
    heads: str, first: str, step: float, rate: float, tmp_path: Path
) -> None:
    t, place, speed, current = _axis(1, step)
    rows = np.column_stack([t * 1e3, place * 1e3, speed * 1e3, current])
    lines = [first, "Datum;14.03.2026 09:12:31", "", heads]
    lines += [
        f"{i};" + ";".join(f"{x:.3f}" for x in row).replace(".", ",") for i, row in enumerate(rows)
    ]
    file, out = tmp_path / "trace.csv", tmp_path / "trace.toml"
    file.write_text("\n".join([*lines, ""]), encoding="utf-8-sig")
    write_starter([file], out, ("", None), False, True)
    text = out.read_text()
    assert 'kind = "drive_force"' in text
    assert heads.split(";")[0] not in text.replace(heads.split(";")[2], "")
    assert re.search(
        r'force = \{ column = "[^"]*(Strom|Current)[^"]*", unit = "N", scale = "\?" \}', text
    )
    out.write_text(text.replace('scale = "?"', "scale = 50"))
    assert read(out).clock.rate == pytest.approx(rate, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "what", "said"),
    [
        ("Stromistwert", "current", "measured"), ("Drehzahlsollwert", "velocity", "command"),
        ("Lageistwert", "position", "measured"), ("Momentensollwert", "torque", "command"),
        ("Solldrehzahl", "velocity", "command"), ("Anlage", "", ""),
    ],
)  # fmt: skip
def test_what_stands_behind_a_german_word(name: str, what: str, said: str) -> None:
    assert (quantity(words(name)), role(words(name))) == (what, said)


def test_what_goes_up_by_one_and_does_not_say_that_it_counts_is_kept(tmp_path: Path) -> None:
    file, out = tmp_path / "a.csv", tmp_path / "a.toml"
    file.write_text("time [s],valve,level\n" + "".join(f"{i / 9},{i % 5},{i}\n" for i in range(99)))
    write_starter([file], out, ("", None), False, True)
    assert 'y = { column = "level"' in out.read_text()
