"""What the page costs: `python -m proofs.page_load [MINUTES]` (Chromium and playwright needed).

First view on a page that was never open; growth of the browser's heap over the time that is given
(two live twins; the slope's 95 % bound); frames a second of a fleet of 200 tiles that change at
1 Hz; processor time that one open page takes of service and page process; lag of the service's
loop without a page, over the minute in which 20 pages open and stay, and over a minute of 20
readers that never read. The browser has the lowest priority: its pictures, drawn without a
graphics card, are not the service's work. The time of day and the load of the machine are printed:
on a machine that does other work the figures are of that machine.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from planted.serving import Served, site
from planted.worlds import record_robot
from proofs._chromium import chromium as found_chromium
from proofs._verdict import NO_DATA, ended

FIRST, SLOPE, TILES, FRAMES, SHARE, LAG = 2.0, 5.0, 200, 30.0, 0.05, 0.020
PAGES = 20
MINUTE = 60.0
"""Seconds that the service looks back for the lag of its loop."""
RATE = 10.0
FLEET = """
const plain = window.fetch;
let beat = 0;
const names = ["good", "out_of_specification", "maintenance_required", "failure"];
window.fetch = async (path, more) => {
  if (!String(path).includes("/api/v1/status")) return plain(path, more);
  beat += 1;
  const twins = Array.from({ length: %d }, (_, k) => ({ name: `twin ${k}`, state: "running",
    reason: "", why: "off by", condition: names[(k + beat) %% 4], stale: false, label: "", age: 0.1,
    rows: 1000 * beat + k, champion: 1, pinned: false, versions: 2, waiting: 0, sources: {},
    headline: `off by ${beat + k} mm`, dropped: 0 }));
  return new Response(JSON.stringify({ site: "hall", twins }), { status: 200 });
};
"""
COUNT = """() => new Promise((done) => {
  const t = [];
  const frame = (now) => (t.push(now), now - t[0] < 5000 ? requestAnimationFrame(frame) : done(t));
  requestAnimationFrame(frame);
})"""


def spent(*processes: int) -> float:
    """Processor time of processes so far [s]."""
    ticks = 0
    for process in processes:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def slope(t: Sequence[float], heap: Sequence[float]) -> tuple[float, float]:
    """Growth a hour and the upper end of its 95 % interval, in the unit of ``heap``."""
    hours, y = np.asarray(t) / 3600.0, np.asarray(heap)
    x = hours - hours.mean()
    grows = float(x @ y / (x @ x))
    left = y - y.mean() - grows * x
    spread = float(np.sqrt(left @ left / max(len(y) - 2, 1) / (x @ x)))
    return grows, grows + 1.645 * spread


def lag(served: Served, began: float) -> float:
    """99th percentile of the loop's lag over the minute that began then [s]."""
    time.sleep(max(began + MINUTE - time.monotonic(), 0.0))
    return float(served.ask("/api/v1/status")[1]["lag"]["p99"])


def silent(served: Served, count: int) -> list[socket.socket]:
    """Readers that open the socket and never read."""
    found = []
    for _ in range(count):
        line = socket.create_connection(("127.0.0.1", served.port))
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.sendall(
            f"GET /api/v1/stream?twin=a HTTP/1.1\r\nHost: 127.0.0.1:{served.port}\r\n"
            f"Authorization: Bearer {served.token}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        found.append(line)
    return found


class Look:
    """A browser before `evertwin page`, and what it is asked for."""

    def __init__(self, browser: Any, address: str) -> None:
        self.browser, self.address = browser, address

    def opened(self, place: str = "", script: str = "") -> Any:
        """A page of a context of its own."""
        page = self.browser.new_context(viewport={"width": 1280, "height": 800}).new_page()
        if script:
            page.add_init_script(script)
        page.goto(f"{self.address}/#/{place}")
        return page

    def first(self) -> float:
        """Seconds until the first tile of the fleet is there, median of five."""
        took = []
        for _ in range(5):
            began = time.perf_counter()
            page = self.opened()
            page.wait_for_selector(".tile")
            took.append(time.perf_counter() - began)
            page.context.close()
        return sorted(took)[2]

    def frames(self) -> float:
        """Frames a second of a fleet whose tiles all change once a second."""
        page = self.opened(script=FLEET % TILES)
        page.wait_for_function(f"() => document.querySelectorAll('.tile').length === {TILES}")
        t = np.diff(page.evaluate(COUNT))
        page.context.close()
        return float(1000.0 / t.mean())

    def heaps(self, seconds: float) -> tuple[list[float], list[float]]:
        """Heap [MB] of the live view once the memory was tidied, over time [s]."""
        page = self.opened("twin/a/live")
        page.wait_for_selector("figure.chart")
        devtools = page.context.new_cdp_session(page)
        t: list[float] = []
        heap: list[float] = []
        began = time.monotonic()
        while time.monotonic() - began < seconds:
            time.sleep(min(10.0, seconds / 20))
            devtools.send("HeapProfiler.collectGarbage")
            used = devtools.send("Runtime.getHeapUsage")["usedSize"]
            t.append(time.monotonic() - began)
            heap.append(used / 1e6)
        page.context.close()
        half = len(t) // 2  # rows fill their ring first
        return t[half:], heap[half:]


def measured(served: Served, look: Look, process: int, minutes: float) -> dict[str, bool]:
    """Every figure, printed; demand → reached."""
    say = sys.stdout.write
    alone = lag(served, time.monotonic())
    before = spent(served.process.pid, process), time.monotonic()
    time.sleep(15.0)
    idle = (spent(served.process.pid, process) - before[0]) / (time.monotonic() - before[1])
    page = look.opened("twin/a/live")
    page.wait_for_selector("figure.chart")
    time.sleep(3.0)
    before = spent(served.process.pid, process), time.monotonic()
    time.sleep(15.0)
    busy = (spent(served.process.pid, process) - before[0]) / (time.monotonic() - before[1])
    page.context.close()
    first, frames = look.first(), look.frames()
    say(f"first view {first:.2f} s (median of 5); {TILES} tiles at 1 Hz: {frames:.0f} frames/s\n")
    say(f"one open page: {100 * (busy - idle):.1f} % of a core (service and page process)\n")
    began = time.monotonic()
    pages = [look.opened("twin/a/live") for _ in range(PAGES)]
    crowd = lag(served, began)
    for page in pages:
        page.context.close()
    lines = silent(served, PAGES)
    slow = lag(served, time.monotonic())
    for line in lines:
        line.close()
    say(f"lag of the loop, p99: {1000 * alone:.1f} ms without a page, {1000 * crowd:.1f} ms with "
        f"{PAGES} pages, {1000 * slow:.1f} ms with {PAGES} readers that never read\n")  # fmt: skip
    grows, most = slope(*look.heaps(60.0 * minutes))
    say(f"heap over {minutes:g} min: {grows:+.2f} MB/h, at most {most:+.2f} (95 %)\n")
    return {
        f"first view within {FIRST:g} s": first <= FIRST,
        f"heap slope below {SLOPE:g} MB/h": most < SLOPE,
        f"{FRAMES:g} frames/s with {TILES} tiles": frames >= FRAMES,
        f"a page below {SHARE:.0%} of a core": busy - idle < SHARE,
        f"lag within {1000 * LAG:g} ms with {PAGES} pages and readers": max(crowd, slow) <= LAG,
    }


def main(minutes: float = 60.0) -> int:
    """Exit code 0 where everything was reached."""
    there = found_chromium()
    if there is None:
        return NO_DATA
    chromium, sync_playwright = there
    with tempfile.TemporaryDirectory() as name, sync_playwright() as driver:
        folder = Path(name)
        length = str(int((60.0 * minutes + 600.0) * RATE))
        record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", length)
        when = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
        load = ", ".join(f"{v:.1f}" for v in os.getloadavg())
        sys.stdout.write(f"{when}; {os.cpu_count()} cores, load {load}; 2 twins, {RATE:g} rows/s\n")
        last = folder / "last"
        last.write_text(f'#!/bin/sh\nexec nice -n 19 {chromium} "$@"\n')
        last.chmod(0o700)
        browser = driver.chromium.launch(
            executable_path=str(last), args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        with Served(site(folder, "a", "b", speed=RATE, workers=1)) as served:
            served.until(lambda status: all(t["rows"] > 30 for t in status["twins"]), 300.0)
            words = [sys.executable, "-m", "evertwin", "page", "--service", served.address,
                     "--port", "0", "--token-file", str(folder / "store" / "token")]  # fmt: skip
            page = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
            try:
                assert page.stdout is not None
                look = Look(browser, page.stdout.readline().strip())
                return ended(measured(served, look, page.pid, minutes))
            finally:
                page.terminate()
                page.wait()
                browser.close()


if __name__ == "__main__":
    raise SystemExit(main(*map(float, sys.argv[1:2])))
