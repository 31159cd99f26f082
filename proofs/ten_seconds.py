"""First screens for readers who never saw the code: `python -m proofs.ten_seconds [FOLDER]`.

Writes one picture a case (1280 × 800, 400 px, a terminal of 80 × 24) with five questions, and apart
from them a key of answers that follows from how each case was made: an improvement by tuning and
by a correction, machines that nothing was wrong with, noise that nothing explains, a trial that is
open, a promotion by hand, a recording in which nothing moves, samples that stay away, a sensor that
lies. People answer; this program only asks. Exit code 0: every picture was written.
"""

from __future__ import annotations

import fcntl
import html
import json
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from planted.serving import Served
from planted.worlds import record_robot
from proofs._chromium import chromium as found_chromium
from proofs._verdict import NO_DATA

OUT = Path(tempfile.gettempdir()) / "tensecond"
SIZES = {"wide": (1280, 800), "narrow": (400, 800), "terminal": (720, 480)}
QUESTIONS = """# Ten seconds each

Look at {picture} for ten seconds, once; then answer without looking again. The picture is all
you get. A *twin* is a simulation that runs beside a machine. Answer `cannot be told` where the
picture does not tell.

1. Does the twin now agree with its machine as well as is asked? (yes / no / cannot be told)
2. Was, or is, something wrong? What, in your words? (nothing / … / cannot be told)
3. Was the twin changed, by itself or by somebody? What? (not changed / … / cannot be told)
4. How much smaller did its error become? (a figure / not smaller / cannot be told)
5. Would you rely on what it predicts right now? (yes / with care / no)
"""
TWIN = """schema = 1
name = "{name}"
beat = 20
[model]
kind = "robot1d"
parameters.gain = {{ value = 1.0, low = 0.5, high = 1.5 }}
[[source]]
name = "log"
time = {{ column = "t", unit = "s" }}
channels.v = {{ column = "v", unit = "m/s" }}
channels.x = {{ column = "x", unit = "m" }}
[arbiter]
use = "tolerance"
tolerance = "2 cm"
[prediction]
horizon = "5 s"
[anomaly]
requirement = "1 cm"
window = 100
[tuning]
window = 200
{more}
"""
ENTRY = """[[twin]]
file = "{name}.toml"
[[twin.source]]
source = "log"
protocol = "replay"
files = ["{name}.csv"]
speed = {speed}
"""


STILL = '[moving]\nabove = 0.01\nchannels = { x = "v" }\n'


class Case(NamedTuple):
    """A first screen, and what follows from how it was made."""

    name: str
    size: str
    key: tuple[str, str, str, str, str]


REPORTS = (
    Case("drive", "wide",
         ("yes", "the drive starts late and is capped", "corrected", "the sentence's", "yes")),
    Case("fits", "narrow", ("yes", "nothing", "not changed", "not smaller", "yes")),
    Case("open", "wide",
         ("no", "off by more than is asked", "not yet: on trial", "not yet", "with care or no")),
)  # fmt: skip
SCREENS = (
    Case("gain", "terminal", ("yes", "it drove too far", "gain", "the sentence's", "yes")),
    Case("noise", "terminal",
         ("no", "off by more than is asked", "not changed", "not smaller", "with care or no")),
    Case("still", "terminal",
         ("cannot be told", "nothing moved", "not changed", "cannot be told", "with care or no")),
)  # fmt: skip
PAGES = (
    Case("silent", "wide", ("cannot be told", "no samples come", "any", "any", "no")),
    Case("hand", "wide",
         ("any", "it was off", "gain, by a person", "any", "with care or no: not proved")),
    Case("sure", "narrow", ("yes", "it drove too far", "gain", "the card's", "yes")),
    Case("calm", "narrow", ("yes", "nothing", "not changed", "not smaller", "yes")),
    Case("lies", "wide",
         ("yes", "a measurement was refused", "not changed", "not smaller", "yes or with care")),
)  # fmt: skip


def cart(file: Path, gain: float, noise: float, rows: int, **odd: float) -> None:
    """A cart that drives by a factor of what it is told; ``still``: it is told nothing; ``jump``:
    metres that a sensor is off by now and then, ``from`` a row on."""
    rng = np.random.default_rng(3)
    told = np.repeat(rng.uniform(0.0, 0.2, rows // 10 + 1), 10)[:rows] * (
        0.0 if "still" in odd else 1.0
    )
    told *= np.where(np.arange(rows) // 40 % 2, -1.0, 1.0)
    x = np.r_[0.0, np.cumsum(gain * told[:-1])] + rng.normal(0.0, noise, rows)
    t = np.arange(rows, dtype=np.float64)
    if "jump" in odd:
        x[int(odd["from"]) :: 25] += odd["jump"]
    np.savetxt(file, np.c_[t, told, x], delimiter=",", header="t,v,x", comments="", fmt="%.9g")


def made(folder: Path) -> None:
    """Twin files and recordings."""
    of = {
        "fits": (1.0, 0.002, 600, {}), "open": (1.1, 0.003, 190, {}), "gain": (1.1, 0.002, 600, {}),
        "noise": (1.0, 0.02, 900, {}), "still": (1.0, 0.002, 600, {"still": 1.0}),
        "silent": (1.1, 0.002, 600, {}), "hand": (1.1, 0.003, 60_000, {}),
        "sure": (1.1, 0.002, 60_000, {}), "calm": (1.0, 0.002, 60_000, {}),
        "lies": (1.0, 0.002, 60_000, {"jump": 0.5, "from": 700}),
    }  # fmt: skip
    for name, (gain, noise, rows, odd) in of.items():
        cart(folder / f"{name}.csv", gain, noise, rows, **odd)
        more = {"hand": "[trial]\nsegments = 5000\nlimit = 100000\n", "still": STILL}.get(name, "")
        (folder / f"{name}.toml").write_text(TWIN.format(name=name, more=more))
    shipped = Path(__file__).parent.parent / "twins" / "robot1d.toml"
    (folder / "drive.toml").write_text(shipped.read_text())
    record_robot(
        folder / "drive.csv", "--light", "--world", "w3", "--seconds", "900", "--seed", "2"
    )


def screen(folder: Path, name: str) -> str:
    """What a terminal of 80 × 24 shows when the command is through."""
    line, end = pty.openpty()
    fcntl.ioctl(end, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    words = [sys.executable, "-m", "evertwin", "run", f"{name}.toml", "--data", f"{name}.csv"]
    environment = {**os.environ, "TERM": "dumb", "COLUMNS": "80", "LINES": "24", "NO_COLOR": "1"}
    process = subprocess.Popen(
        words, cwd=folder, stdin=end, stdout=end, stderr=subprocess.DEVNULL, env=environment
    )
    os.close(end)
    said = b""
    while True:
        try:
            piece = os.read(line, 65536)
        except OSError:
            break
        if not piece:
            break
        said += piece
    process.wait()
    wrapped = [text[k : k + 80] for text in said.decode().replace("\r", "").rstrip("\n").split("\n")
               for k in range(0, max(len(text), 1), 80)]  # fmt: skip
    command = f"$ evertwin run {name}.toml --data {name}.csv"
    return "\n".join([command, *wrapped][-23:]) + "\n$ "


def page_cases(folder: Path, shoot: Any) -> None:
    """A service with all live cases, and the page before it."""
    names = [case.name for case in PAGES]
    head = 'schema = 1\nname = "hall"\nwarm = false\nstore = "store"\n[http]\nport = 0\n'
    entries = "".join(ENTRY.format(name=name, speed=40) for name in names)
    # a log that does not grow any more
    follows = 'protocol = "file"\npath = "silent.csv"\n'
    entries = entries.replace('protocol = "replay"\nfiles = ["silent.csv"]\nspeed = 40\n', follows)
    (folder / "site.toml").write_text(head + entries)
    with Served(folder / "site.toml") as served:
        words = [sys.executable, "-m", "evertwin", "page", "--service", served.address, "--port",
                 "0", "--token-file", str(folder / "store" / "token")]  # fmt: skip
        page = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        try:
            assert page.stdout is not None
            page.stdout.readline()
            enter = page.stdout.readline().split()[-1]
            served.until(lambda s: all(one["rows"] > 550 for one in s["twins"]), 300.0)
            _until_trial(served)
            told = {
                "order": "promote",
                "version": 1,
                "reason": "looks better to me",
                "person": "Kim",
            }
            sys.stdout.write(
                f"promoted by hand: {served.ask('/api/v1/twins/hand/orders', told)[0]}\n"
            )
            time.sleep(15.0)
            for case in PAGES:
                shoot(case, f"{enter.split('/enter')[0]}/#/twin/{case.name}/live", enter)
        finally:
            page.terminate()
            page.wait()


def _until_trial(served: Served) -> None:
    """Until there is something to promote by hand."""
    for _ in range(120):
        if len(served.ask("/api/v1/twins/hand")[1]["versions"]) > 1:
            return
        time.sleep(0.5)
    raise TimeoutError("no candidate came for the case 'hand'")


def main(out: Path = OUT) -> int:
    """Exit code 0 where every picture was written."""
    there = found_chromium()
    if there is None:
        return NO_DATA
    chromium, sync_playwright = there
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name, sync_playwright() as driver:
        folder = Path(name)
        made(folder)
        browser = driver.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )

        def shoot(case: Case, address: str, enter: str = "") -> None:
            wide, high = SIZES[case.size]
            context = browser.new_context(viewport={"width": wide, "height": high})
            page = context.new_page()
            if enter:
                page.goto(enter)
            page.goto(address)
            page.wait_for_timeout(4000 if enter else 500)
            page.screenshot(path=out / f"{case.name}.png")
            context.close()

        for case in REPORTS:
            words = [sys.executable, "-m", "evertwin", "run", f"{case.name}.toml", "--data",
                     f"{case.name}.csv", "--report", f"{case.name}.html"]  # fmt: skip
            subprocess.run(words, cwd=folder, check=True, capture_output=True)
            shoot(case, f"file://{folder}/{case.name}.html")
        for case in SCREENS:
            text = html.escape(screen(folder, case.name))
            look = (
                "margin:0;background:#111;color:#eee;font:14.9px/20px 'DejaVu Sans Mono',monospace"
            )
            (folder / "screen.html").write_text(
                f"<body style='{look}'><pre style='margin:0'>{text}"
            )
            shoot(case, f"file://{folder}/screen.html")
        page_cases(folder, shoot)
        browser.close()
    cases = [*REPORTS, *SCREENS, *PAGES]
    for case in cases:
        (out / f"{case.name}.md").write_text(QUESTIONS.format(picture=f"{case.name}.png"))
    (out / "key.json").write_text(json.dumps({case.name: case.key for case in cases}, indent=1))
    sys.stdout.write(f"{len(cases)} first screens in {out}; the answers lie apart in key.json\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(*map(Path, sys.argv[1:2])))
