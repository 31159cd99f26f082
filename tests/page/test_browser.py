"""Every view in a real Chromium, beside a real service: what people see and may do."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from planted.draws import first_of
from planted.serving import TWINS, Served, site
from planted.worlds import record_arm, record_robot
from tests.service.test_adding import cart
from tests.sources.live.test_modbus import server

pytestmark = pytest.mark.system
HOSTILE = '"><img src=x onerror="window.hit=1"><script>window.hit=1</script>'
GHOST = """async () => {
  const { exceeds, leaning } = await import("/static/scene.js");
  const joints = ["a", "b"].map((output) => ({ output, position: [0, 0, 1], slides: false }));
  const held = (r) => ({ residual: Array(30).fill(r), measured: Array(30).fill(-20) });
  const turned = (a, b) => leaning(joints, [0, 0], exceeds(joints, { a: held(a), b: held(b) }, 29));
  const degrees = (one) => one.map((v) => Math.round((v * 1800) / Math.PI) / 10);
  return [turned(0, null), turned(2, -90)].map(degrees);
}"""
TABLES = """async () => {
  const { tables } = await import("/static/scene.js");
  const row = { "table2.x": 1, "table2.y": 2, "table2.heading": Math.PI / 2, "table2.length": 1.2,
    "table2.width": 0.8, "table2.leg": 0.1, "table1.length": 0 };
  const round = (v) => Math.round(100 * v) / 100 + 0;
  const drawn = tables(2, 0.6, (name) => row[name]);
  return drawn.map(({ a, points }) => (a ?? points.flat()).map(round));
}"""
TRUST = """async () => {
  const { trust } = await import("/static/verdict.js");
  const { levelOf, quantity, unitOf } = await import("/static/words.js");
  const about = {
    state: "running", condition: "good", age: 0, parameters: [], asked: 0.01, refused: [],
    outputs: [{ name: "x", unit: "m" }], figures: { x: { unit: "m", rows: 99 } },
  };
  const promoted = { evidence: { segments: 20, version: 1 } };
  const out = { judged: "off", condition: "out_of_specification", why: "x is off" };
  const told = [
    { judged: "held" }, { judged: "off" }, { judged: "not yet" }, out,
    { judged: "held", refused: ["x"] }, { judged: "held", state: "starting", condition: "check" },
  ];
  const tag = (one, champion, by) => trust({ ...about, ...one, champion }, by)[0];
  const tags = told.map((one) => [tag(one, 1, promoted), tag(one, 0)]);
  const rpm = unitOf({ unit: "rad/s", shown: { unit: "rpm", factor: Math.PI / 30 } });
  const warm = { unit: "K", shown: { unit: "degC", factor: 1, zero: 273.15, apart: "K" } };
  return [tags, quantity(Math.PI, rpm), quantity(294.25, levelOf(warm)), quantity(2, unitOf(warm))];
}"""
NEWEST = """() => {
  const { scrollWidth, clientWidth } = document.querySelector(".newest .scroll");
  return [scrollWidth, clientWidth];
}"""
RENEWED = """async () => {
  const { h, renew, table } = await import("/static/dom.js");
  const pane = h("div", {});
  document.querySelector("#main").append(pane);
  const shown = (...rows) => renew(pane, table("Newest", ["", "value"], rows));
  shown(["x", "1 m"], ["v", "2 m/s"]);
  const region = pane.firstChild;
  region.focus();
  const held = () => pane.firstChild === region && document.activeElement === region;
  shown(["x", "3 m"], ["v", "4 m/s"]);
  const same = [held(), region.querySelector("tbody").textContent];
  shown(["x", "5 m"]);
  const other = [held(), pane.querySelector("tbody").textContent];
  pane.remove();
  return [same, other];
}"""
WIDE = """async () => {
  const { h, table } = await import("/static/dom.js");
  const { parted, quantity } = await import("/static/words.js");
  const values = [["a_long_name_of_an_output", "m^2.5/s"], ["tau", "Nm"], ["x", "m/s"], ["n", "1"]];
  const sizes = [-1.234e-4, -1.234e-7, -98765.4, 3.21e12, 0.5];
  const rows = values.map(([name, unit]) =>
    sizes.map((size) => [name, ...Array(3).fill(parted(quantity(size, unit)))]));
  const headings = ["", "measured", "predicted", "off by"];
  const pane = h("div", { class: "card newest" }, table("Newest row", headings, rows.flat()));
  const chart = h("div", { class: "card" }, "chart");
  const columns = h("div", { class: "columns" }, chart, h("div", {}, pane));
  document.querySelector("#main").append(columns);
  const { scrollWidth, clientWidth } = pane.querySelector(".scroll");
  columns.remove();
  return [scrollWidth, clientWidth];
}"""
SUMMED = """async () => {
  const { summed } = await import("/static/views/fleet.js");
  const known = ["good good", "good unjudged", "unjudged stale failure good"];
  return [[], ...known.map((all) => all.split(" "))].map(summed);
}"""
VIEWS = ("live", "improvement", "events", "signals", "life", "engineering", "faults")
ARM = """
[[twin]]
file = "arm.toml"
workers = 0
[[twin.source]]
source = "controller"
protocol = "replay"
files = ["cycle-0000.csv", "cycle-0001.csv"]
speed = 2
"""
SHOWN = "document.documentElement.dataset.up"
ROWS = "(({row, outputs}) => [[...row], [...outputs.x.measured]])(window.evertwin.feed.rows)"


def free_port() -> int:
    with socket.socket() as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


class Shown:
    """A service, `evertwin page` and a browser."""

    def __init__(self, folder: Path, browser: Any) -> None:
        self.file = site(folder, "robot", speed=25, http=f"port = {free_port()}")
        text = self.file.read_text().replace('name = "hall"', f"name = '{HOSTILE}'")
        self.file.write_text(text)
        with self.file.open("a") as more:
            more.write(ARM)
        self.served = Served(self.file)
        words = [
            sys.executable, "-m", "evertwin", "page", "--service", self.served.address, "--port",
            "0", "--token-file", str(folder / "store" / "token"), "--machine", "arm=127.0.0.1:9",
        ]  # fmt: skip
        environment = {**os.environ, "JAXTYPING_DISABLE": "1"}
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment)
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        self.enter = self.process.stdout.readline().split()[-1]
        self.errors: list[str] = []
        self.context = browser.new_context(viewport={"width": 1024, "height": 768})
        self.page = self.context.new_page()
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on(
            "console", lambda said: self.errors.append(said.text) if said.type == "error" else None
        )
        self.served.until(lambda status: status["twins"][0]["rows"] > 30)

    def go(self, place: str) -> Any:
        self.page.goto(f"{self.address}/#/{place}")
        self.page.wait_for_selector("#main :is(h1, h2)")
        self.page.wait_for_function(f"() => {SHOWN} === 'yes'")
        return self.page

    def awake(self, twin: str = "robot", rows: int = 1500) -> None:
        """A recording lasts for a minute or two: it begins anew where others have taken so long."""
        if self.served.twin(twin)["rows"] < rows:
            return
        self.served.end()
        for kept in (self.file.parent / "store").glob(f"{twin}.db*"):
            kept.unlink()
        self.served = Served(self.file)
        self.served.until(lambda status: status["twins"][0]["rows"] > 30)
        self.errors.clear()

    def close(self) -> None:
        self.context.close()
        self.process.terminate()
        with self.process:
            self.process.wait(10)
        if self.served.process.poll() is None:
            self.served.end()


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("chromium is not installed")
    playwright = pytest.importorskip("playwright.sync_api")
    folder = tmp_path_factory.mktemp("page")
    record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", "3000", "--seed", "2")
    record_arm(folder, "--cycles", "2", "--seed", "3")
    shutil.copy(TWINS / "arm.toml", folder)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        found = Shown(folder, browser)
        try:
            found.page.goto(found.enter)
            yield found
        finally:
            found.close()
            browser.close()


@pytest.mark.parametrize("place", ["", *(f"twin/robot/{view}" for view in VIEWS), "add"])
def test_each_view_is_whole_in_light_and_dark_and_on_a_tablet(shown: Shown, place: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    page = shown.go(place)
    if place.endswith("engineering"):
        page.wait_for_selector("#schedule table", timeout=60_000)
    serious = []
    for look in ("light", "dark"):
        page.evaluate(
            f"document.documentElement.classList.remove('light', 'dark'), "
            f"document.documentElement.classList.add('{look}')"
        )
        page.wait_for_timeout(200)
        told = axe.run(page).response
        assert len(told["passes"]) > 10
        found = told["violations"]
        serious += [
            (look, one["id"], [node["html"][:150] for node in one["nodes"]][:2])
            for one in found if one["impact"] in ("serious", "critical")
        ]  # fmt: skip
    assert serious == []
    assert page.evaluate("document.documentElement.scrollWidth") <= 1024
    picture(page, place)
    refused = ("status of 400", "status of 502")  # no indicator; no embedded machine listens
    assert [one for one in shown.errors if not any(word in one for word in refused)] == []
    assert "undefined" not in page.inner_text("main") and "NaN" not in page.inner_text("main")


def picture(page: Any, place: str) -> None:
    """Of the documentation, where somebody asks for new ones."""
    folder = os.environ.get("EVERTWIN_PICTURES")
    if not folder or not place.endswith(("live", "improvement", "events", "add")):
        return
    page.evaluate("document.documentElement.classList.replace('dark', 'light')")
    page.evaluate("document.querySelector('#top .brand').textContent = 'evertwin · hall'")
    if place.endswith("improvement"):
        page.click("#compare")
        page.wait_for_selector("#rivals table", timeout=60_000)
    page.wait_for_timeout(3000)
    page.evaluate("scrollTo(0, 0)")
    page.screenshot(path=Path(folder) / f"page-{place.rpartition('/')[2]}.png", full_page=True)


def test_the_keyboard_reaches_everything(shown: Shown) -> None:
    page = shown.go("twin/robot/improvement")
    page.wait_for_selector("#order-promote")
    wanted = page.evaluate(
        "[...document.querySelectorAll('a[href], button:not(:disabled), input, select, summary, "
        "canvas')].filter((one) => one.checkVisibility()).length"
    )
    page.evaluate("document.activeElement.blur(), (window.seen = new Set())")
    for _ in range(3 * wanted + 10):
        page.keyboard.press("Tab")
        page.evaluate(
            "document.activeElement.matches('a, button, input, select, summary, canvas') && "
            "window.seen.add(document.activeElement)"
        )
        if page.evaluate("window.seen.size") >= wanted:
            break
    assert page.evaluate("window.seen.size") >= wanted


def test_an_order_changes_the_next_rows_and_hostile_words_are_text(shown: Shown) -> None:
    shown.awake()
    page, served = shown.go("twin/robot/improvement"), shown.served
    served.until(lambda status: status["twins"][0]["versions"] > 1)
    page.reload()
    page.wait_for_selector("#order-pin")
    twin = served.ask("/api/v1/twins/robot")[1]
    other = next(v["number"] for v in twin["versions"] if v["number"] != twin["champion"])
    page.select_option("#version", str(other))
    page.fill("#person", HOSTILE)
    page.fill("#reason", HOSTILE)
    page.click("#order-promote")
    page.wait_for_function(
        f"() => window.evertwin.feed.rows.version.at(-1) === {other}", timeout=30_000
    )
    events = served.ask("/api/v1/twins/robot/events?last=50")[1]["events"]
    (ordered,) = [e for e in events if e["evidence"].get("person") == HOSTILE]
    assert ordered["kind"] == "promoted" and HOSTILE in ordered["reason"]
    page = shown.go("twin/robot/events")
    page.wait_for_selector(f"#event-{ordered['number']}")
    page.click(f"#event-{ordered['number']}")
    page.fill("#person", HOSTILE)
    page.fill("#reason", HOSTILE)
    page.click("#say-acknowledged")
    page.wait_for_selector("text=kept; the condition")
    shown.go("")
    assert HOSTILE in page.inner_text("#top")
    assert page.evaluate("window.hit") is None and page.query_selector("main img") is None


def test_what_was_live_before_is_live_again_at_a_click(shown: Shown) -> None:
    shown.awake()
    page, served = shown.go("twin/robot/improvement"), shown.served
    served.until(lambda status: status["twins"][0]["versions"] > 1)
    before = served.twin("robot")["champion"]
    other = next(v["number"] for v in served.ask("/api/v1/twins/robot")[1]["versions"]
                 if v["number"] != before)  # fmt: skip
    page.reload()
    for button, live in (("promote", other), ("rollback", before)):
        page.wait_for_selector(f"#order-{button}")
        page.select_option("#version", str(other))
        page.fill("#person", "ada")
        page.fill("#reason", f"to see: {button}")
        page.click(f"#order-{button}")
        page.wait_for_function(
            f"() => window.evertwin.feed.rows.version.at(-1) === {live}", timeout=30_000
        )
    events = served.ask("/api/v1/twins/robot/events?last=50")[1]["events"]
    (back,) = [e for e in events if "to see: rollback" in e["reason"]]
    assert back["kind"] == "rolled_back" and back["evidence"]["person"] == "ada"
    assert served.twin("robot")["champion"] == before


def test_a_label_acts_and_what_it_changed_stands_beside_the_event(shown: Shown) -> None:
    shown.awake()
    page, served = shown.go("twin/robot/events"), shown.served
    served.until(lambda status: status["twins"][0]["rows"] > 120)
    page.reload()
    number = served.ask("/api/v1/twins/robot/events?last=500")[1]["events"][0]["number"]
    page.click(f"#event-{number}")
    page.fill("#person", "ada")
    page.fill("#reason", HOSTILE)
    first = served.twin("robot")["rows"] - 60  # of those that are kept, however fast it goes
    page.fill("#first", str(first))
    page.fill("#last", str(first + 19))
    page.click("#say-faulty")
    page.wait_for_selector(".did", timeout=30_000)
    said = f"20 rows leave the window of fits (row {first} to row {first + 19})"
    assert said in page.inner_text(".did")
    events = served.ask("/api/v1/twins/robot/events?last=500")[1]["events"]
    (said,) = [e for e in events if e["kind"] == "heeded"]
    assert said["evidence"]["event"] == number and page.evaluate("window.hit") is None
    picture(page, "twin/robot/events")


def test_a_table_of_the_newest_values_keeps_the_place_of_keyboard_and_selection(
    shown: Shown,
) -> None:
    said = shown.go("").evaluate(RENEWED)
    assert said == [[True, "x3 mv4 m/s"], [False, "x5 m"]]


def test_a_channel_that_is_not_what_it_was_is_no_wrong_form(shown: Shown) -> None:
    said = shown.go("").evaluate("""async () => {
        const { kind } = await import("/static/words.js");
        return [{ number: 1.8 }, {}].map((evidence) => kind({ kind: "abnormal", evidence }));
    }""")
    assert said == ["sensor in doubt", "form is wrong"]


def test_it_goes_on_by_itself_where_the_service_was_killed(shown: Shown) -> None:
    shown.awake()
    page = shown.go("twin/robot/live")
    page.reload()
    page.wait_for_function("() => window.evertwin?.feed?.rows.row.length > 20")
    page.evaluate("window.here = 1")
    shown.served.kill()
    page.wait_for_function("() => document.getElementById('banner').textContent.includes('old')")
    assert "No connection" in page.inner_text("#banner")
    last = page.evaluate("window.evertwin.feed.rows.newest")
    shown.served = Served(shown.file)
    shown.served.until(lambda status: status["twins"][0]["rows"] > last)
    page.wait_for_function(f"() => window.evertwin.feed.rows.newest > {last + 3}", timeout=5_000)
    assert page.evaluate("window.here") == 1 and page.url.endswith("#/twin/robot/live")
    page.wait_for_function("() => !document.getElementById('banner').classList.contains('on')")
    rows, seen = page.evaluate(ROWS)
    assert rows == list(range(rows[0], rows[-1] + 1))
    kept = shown.served.ask("/api/v1/twins/robot/rows?last=10000&points=10000")[1]
    number = kept["row"].index(rows[0])
    assert seen == kept["outputs"]["x"]["measured"][number : number + len(seen)]
    numbers = page.evaluate("() => window.evertwin.feed.events.map((e) => e.number)")
    told = shown.served.ask("/api/v1/twins/robot/events?last=500")[1]["events"]
    assert numbers == sorted(set(numbers)) == [e["number"] for e in told][: len(numbers)]
    shown.errors.clear()  # the browser tells each question that found nobody


@first_of("place", ["twin/robot/live", "", "twin/robot/improvement"])
def test_what_a_service_that_hangs_said_last_is_stale(shown: Shown, place: str) -> None:
    """The line is up and nothing comes by it: the page tells by its own clock."""
    shown.awake()
    page, process = shown.go(place), shown.served.process
    seen = ".tile, #verdict"
    page.wait_for_selector(seen)
    page.wait_for_timeout(1000)
    fresh = "() => !/stale/i.test(document.getElementById('main').innerText)"
    page.wait_for_function(fresh, timeout=30_000)  # a twin is opened in its own time
    os.kill(process.pid, signal.SIGSTOP)
    try:
        page.wait_for_function(
            "() => document.getElementById('banner').textContent.includes('does not answer')",
            timeout=6000,
        )
        page.wait_for_timeout(2500)
        said = page.inner_text(seen)
        assert "STALE" in said.upper() and "has not answered for" in said, said
        assert "All" not in page.inner_text("#main")[:200] or place
        assert page.query_selector("#main .sign.good") is None
        ages = []
        for _ in range(2):
            ages.append(float(re.findall(r"answered for (\d+) s", page.inner_text(seen))[0]))
            page.wait_for_timeout(2200)
        assert ages[0] >= 3 and ages[1] >= ages[0] + 1
    finally:
        os.kill(process.pid, signal.SIGCONT)
    page.wait_for_function(
        "() => !document.getElementById('banner').classList.contains('on')", timeout=15_000
    )
    page.wait_for_function(
        "(seen) => !document.querySelector(seen).textContent.includes('not answered')",
        arg=seen, timeout=15_000,
    )  # fmt: skip
    shown.errors.clear()


PINNED = """async () => {
  const { pinnedLive } = await import("/static/verdict.js");
  const event = (kind, version) => ({ kind, evidence: { version } });
  const told = [event("promoted", 1), event("promoted", 2), event("rolled_back", 1)];
  const by = (version, ...more) => pinnedLive([...told, ...more], version)?.kind ?? null;
  return [by(1), by(2, event("pinned", 2)), by(1, event("pinned", 1)), by(1, event("pinned", 2))];
}"""


def test_a_pin_keeps_what_is_live_and_asks_before_it_changes_that(shown: Shown) -> None:
    shown.awake()
    page, served = shown.go("twin/robot/improvement"), shown.served
    assert page.evaluate(PINNED) == [None, "pinned", None, None]
    served.until(lambda status: status["twins"][0]["versions"] > 1)
    versions = served.ask("/api/v1/twins/robot")[1]["versions"]
    first = {"order": "promote", "version": 0, "person": "ada", "reason": "as it was"}
    for _ in range(5):  # what is on trial may go live at any time
        if served.twin("robot")["champion"]:
            served.ask("/api/v1/twins/robot/orders", first)
            served.until(lambda status: status["twins"][0]["champion"] == 0)
        page.reload()
        page.wait_for_selector("#order-pin")
        page.wait_for_function("() => document.getElementById('version').options.length > 1")
        if page.input_value("#version") == "0":
            break
    assert page.input_value("#version") == "0" != str(versions[-1]["number"])
    assert ", live" in page.inner_text("#version option:checked")
    asked = list[str]()
    page.once("dialog", lambda box: (asked.append(box.message), box.dismiss()))
    page.fill("#person", "ada")
    page.fill("#reason", "over the weekend")
    page.select_option("#version", str(versions[-1]["number"]))
    page.click("#order-pin")
    page.wait_for_selector("text=nothing was changed")
    assert "goes live in place of 0" in asked[0] and not served.twin("robot")["pinned"]
    page.select_option("#version", "0")
    page.click("#order-pin")
    served.until(lambda status: status["twins"][0]["pinned"])
    assert len(asked) == 1 and served.twin("robot")["champion"] == 0
    unpin = {"order": "unpin", "version": None, "person": "ada", "reason": "go on"}
    assert served.ask("/api/v1/twins/robot/orders", unpin)[0] == 200


def test_the_past_is_drawn_without_a_seam(shown: Shown) -> None:
    page = shown.go("twin/robot/live")
    page.wait_for_selector("canvas")
    before = page.inner_text("#at")
    page.click("#pause")
    page.click("#back")
    page.wait_for_function(
        "(text) => document.getElementById('at').textContent !== text", arg=before
    )
    assert page.get_attribute("#pause", "aria-pressed") == "true"
    page.focus("figure canvas")
    page.keyboard.press("ArrowLeft")
    assert "x" in page.inner_text("figure.chart .legend") and page.query_selector(".legend output")
    page.keyboard.press("Escape")
    page.click("#pause")


def test_the_ghost_of_an_arm_goes_where_the_torques_differ(shown: Shown) -> None:
    """The twin thinks half of the joints' friction: its simulated arm runs ahead of the machine."""
    shown.awake("arm", 400)
    shown.served.until(lambda status: status["twins"][1]["rows"] > 150)
    page = shown.go("twin/arm/live")
    page.wait_for_selector("canvas.scene")
    page.wait_for_function(
        "() => /Ghost: turned most/.test(document.querySelector('#leans').textContent)"
    )
    calm, off = page.evaluate(GHOST)
    assert calm == [0, 0], "as predicted: the ghost stands in the machine"
    assert off == [5, -30], "10 % of the usual torque; far more than is drawn"
    picture(page, "twin/arm/arm_live")
    # the second: whatever values and units there are
    for wide, room in (page.evaluate(NEWEST), page.evaluate(WIDE)):
        assert 0 < wide <= room, "each figure with its unit"
    assert "of its usual torque" in page.inner_text("#leans")


def test_tables_of_the_simulated_world_stand_where_the_model_has_them(shown: Shown) -> None:
    *legs, plate = shown.go("").evaluate(TABLES)
    assert legs == [[0.7, 2.5, 0], [0.7, 1.5, 0], [1.3, 1.5, 0], [1.3, 2.5, 0]]
    assert plate[:6] == [0.7, 2.5, 0.6, 0.7, 1.5, 0.6] and plate[-3:] == plate[:3]


def test_what_was_never_judged_is_not_counted_as_good(shown: Shown) -> None:
    none, good, *others = shown.go("").evaluate(SUMMED)
    assert (none, good) == ("No twins yet.", "All 2 good.")
    assert others == ["1 not judged, 1 good.", "2 twins need attention, 1 not judged, 1 good."]


def test_nothing_is_trusted_that_is_off_or_not_checked(shown: Shown) -> None:
    """Whatever a trial had proved; and an output is told in the unit of its twin file."""
    tags, told, *warm = shown.go("").evaluate(TRUST)
    assert tags[0] == ["Yes", "Yes"] and told == "30.0\u00a0rpm"
    assert warm == ["21.1°C", "2.00\u00a0K"]
    assert all("Yes" not in both for both in tags[1:]), tags


def test_a_machine_is_added_from_its_registers_to_a_twin_file(shown: Shown) -> None:
    with server(cart) as port:
        page = shown.go("add")
        page.select_option("#protocol", "modbus")
        page.fill("#port", str(port))
        page.click("#look")
        page.wait_for_selector(".heard:has-text('float32')")
        page.click("#stop")
        page.select_option("#kind", "robot1d")
        for row, words in enumerate([("0:float32", "v", "cm/s"), ("2:float32", "x", "cm")]):
            for key, word in zip(("place", "name", "unit"), words, strict=True):
                page.fill(f"tbody tr:nth-child({row + 1}) .{key}", word)
        page.fill("#seconds", "2")
        page.click("#try")
        page.wait_for_selector("#site-file", timeout=60_000)
        picture(page, "add")
    assert 'kind = "robot1d"' in page.inner_text("#twin-file")
    assert 'x = { address = 2, type = "float32" }' in page.inner_text("#site-file")
    assert page.inner_text("tbody tr:nth-child(1) .value").startswith("20")
    assert "off by" in page.inner_text("#found table")
    answer = shown.context.browser.new_context().request.post(
        f"{shown.address}/api/v1/draft", data={"protocol": "modbus"}
    )
    assert answer.status == 401, "who may only look makes the service ask no machine"


def test_who_has_no_cookie_may_only_look(shown: Shown) -> None:
    answer = shown.context.browser.new_context().request.post(
        f"{shown.address}/api/v1/twins/robot/orders", data={"order": "rollback", "reason": "x"}
    )
    assert answer.status == 401
    cookie = next(iter(shown.context.cookies()))
    assert cookie["httpOnly"] and cookie["sameSite"] == "Strict"
    assert re.fullmatch(r"[0-9a-f]{40}", cookie["value"])


def test_a_fleet_shows_who_runs_what_and_how_late(shown: Shown) -> None:
    """What runs nowhere first; names of others are text."""
    free = {"twin": HOSTILE, "node": "south", "state": "free", "age": None, "lag": None, "row": 7,
            "wanted": "", "reason": ""}  # fmt: skip
    owned = {**free, "twin": "arm", "node": "north", "state": "owned", "age": 1.2, "lag": 3.4}
    waits = {**free, "twin": "lift", "state": "waits", "reason": "north cannot: no plug-in"}
    node = {"node": "north", "alive": True, "drains": False, "twins": 1, "cost": 0.074}
    told = {"lease": 5.0, "nodes": [node], "twins": [owned, waits, free]}

    def shares(route: Any) -> None:
        answer = route.fetch()
        route.fulfill(response=answer, json={**answer.json(), "fleet": True})

    shown.page.route("**/api/v1/status", shares)
    shown.page.route("**/api/v1/fleet", lambda route: route.fulfill(json=told))
    page = shown.go("")
    page.wait_for_selector("#nodes table")
    rows = page.locator("#nodes table").first.locator("tbody tr").all_inner_texts()
    page.unroute_all()
    assert sorted(row.split("\t")[:4] for row in rows[:2]) == [
        [HOSTILE, "nowhere: it is free", "–", "–"], ["lift", "nowhere: it waits", "–", "–"],
    ]  # fmt: skip
    assert rows[2].split("\t")[:4] == ["arm", "north", "1.2 of 5 s", "3.4 s"]
    assert any(row.endswith("north cannot: no plug-in") for row in rows)
    assert page.evaluate("window.hit") is None
