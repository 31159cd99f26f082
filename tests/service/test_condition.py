"""What a twin is said to be: by what its live version does now, and until it is over."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.fold import Chunk
from evertwin.service.health.condition import Condition
from evertwin.service.health.deviation_now import Now
from evertwin.service.health.past_tense import past
from evertwin.service.site.site_plan import read_site
from evertwin.service.twin.live_twin import AtWork
from evertwin.store import Batch, Estimate
from planted.draws import first_of

SITE = """schema = 1
name = "hall"
[[twin]]
file = "cart.toml"
workers = 0
"""
TWIN = """schema = 1
name = "cart"
beat = "2 s"
[model]
kind = "robot1d"
[model.parameters]
gain = { value = 1.0, low = 0.2, high = 3.0 }
[[source]]
name = "log"
[source.channels]
v = { column = "v", unit = "m/s" }
x = { column = "x", unit = "m" }
[clock]
rate = 10
[arbiter]
use = "tolerance"
tolerance = "2 cm"
[prediction]
horizon = "2 s"
[anomaly]
requirement = "1 cm"
outputs = ["x"]
window = "20 s"
[tuning]
window = "60 s"
"""


class Beside:
    """A twin at work beside a cart, and its condition, as a runner keeps both."""

    def __init__(self, work: AtWork, seed: int) -> None:
        self.work, self.rng = work, np.random.default_rng(seed)
        self.condition = Condition({"log": math.inf}, 600.0, asked=True)
        self.k, self.x, self.v, self.kinds = 0, 0.0, 0.2, list[str]()
        self.log: list[Any] = []
        self.heard: dict[int | None, str] = {None: "suspected"}
        """Kind of each event; an alarm need not have one yet."""

    def drive(self, rows: int, gain: float, stays: float | None = None) -> dict[str, Any]:
        """So many rows, ten at a time; the condition after them. ``stays``: all that x says."""
        for _ in range(rows // 10):
            t, v = np.arange(self.k, self.k + 10) * 10**8, np.zeros((10, 2))
            for i in range(10):
                self.x += 0.1 * gain * self.v
                if self.rng.uniform() < 0.05:
                    self.v = float(self.rng.choice([-1.0, 1.0]) * self.rng.uniform(0.1, 0.3))
                v[i] = self.v, self.x + self.rng.normal(0.0, 5e-4) if stays is None else stays
            self.k += 10
            self.condition.came("log")
            said = self.work.fold(self.work.keep([Chunk("log", t, v)]))
            for _, event in said.events:
                self.kinds.append(str(event["kind"]))
                self.log.append(event)
                self.heard[event["number"]] = str(event["kind"])
                self.condition.heard(event)
            self.work.looked_at()
            self.condition.looked(self.work.now)
            told = self.condition.told(failed=False)
            for one in (told["alarm"], told["returned"]):
                assert one is None or self.heard[one["event"]] == one["kind"]
        return self.condition.told(failed=False)

    def off(self) -> float:
        """Rms of what the live version was off by over its newest 20 s."""
        view = self.work.going.view(200)
        own = view.off[view.version == self.work.twin.champion.number, 0]
        own = own[np.isfinite(own)]
        return float(np.sqrt(np.mean(own**2))) if len(own) >= 5 else 0.0


@first_of("seed", range(5))
def test_no_twin_is_good_while_its_live_version_is_off(tmp_path: Path, seed: int) -> None:
    """Explained, and a better one on trial: the live version is as far off as before."""
    (tmp_path / "site.toml").write_text(SITE)
    (tmp_path / "cart.toml").write_text(TWIN)
    (tmp_path / "store").mkdir()
    with closing(AtWork(read_site(tmp_path / "site.toml").twins[0], tmp_path / "store")) as work:
        cart = Beside(work, seed)
        assert cart.drive(400, 1.0)["condition"] == "good"
        assert work.about["judged"] == "held"
        trials = 0
        for _ in range(40):
            told = cart.drive(10, 1.6)
            trials += work.about["trial"] is not None
            if cart.off() > 0.015:
                assert told["condition"] == "out_of_specification" and told["alarm"]
                assert work.about["judged"] == "off"
        assert trials > 3 and "normal" in cart.kinds
        told = cart.drive(600, 1.6)
        assert "promoted" in cart.kinds and work.about["judged"] == "held"
        assert told["condition"] == "good" and told["returned"]["reason"].startswith("x was off by")


def test_a_twin_without_rows_says_what_it_waits_for(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(SITE)
    (tmp_path / "cart.toml").write_text(TWIN.replace("rate = 10\n", ""))
    (tmp_path / "store").mkdir()
    with closing(AtWork(read_site(tmp_path / "site.toml").twins[0], tmp_path / "store")) as work:
        assert work.about["headline"] == "No rows yet."
        work._when = 0.0
        t = np.arange(20) * 60 * 10**9
        work.fold(work.keep([Chunk("log", t, np.zeros((20, 2)))]))
        assert "the first 64 tell how often they come, 20 did" in work.about["headline"]


@first_of("seed", range(5))
def test_an_alarm_whose_cause_is_over_has_returned_to_normal(tmp_path: Path, seed: int) -> None:
    """Without a label, and also after a process that was killed."""
    (tmp_path / "site.toml").write_text(SITE)
    (tmp_path / "cart.toml").write_text(TWIN + "editable = []\n")
    (tmp_path / "store").mkdir()
    plan = read_site(tmp_path / "site.toml").twins[0]
    with closing(AtWork(plan, tmp_path / "store")) as work:
        cart = Beside(work, seed)
        cart.drive(300, 1.0)
        told = cart.drive(100, 1.6)
        assert told["condition"] == "out_of_specification" and " is " in told["why"]
        told = cart.drive(400, 1.0)
        assert told["condition"] == "good" and told["alarm"] is None
        over = told["returned"]
        assert "off by" in over["reason"] and " is " not in over["reason"] and not over["label"]
        assert 40 * 10**9 <= over["over"] <= 70 * 10**9
    with closing(AtWork(plan, tmp_path / "store")) as work:
        again = Condition({"log": math.inf}, asked=True)
        again.came("log")
        for _, event in work.before:
            again.heard(event)
        again.looked(work.now)
        told = again.told(failed=False)
        assert told["condition"] == "good" and told["returned"]["reason"] == over["reason"]


@first_of("seed", range(5))
def test_what_was_over_before_a_restart_is_over_though_something_else_is_out(
    tmp_path: Path, seed: int
) -> None:
    """The log has no end of an alarm: what rows said in between tells it."""
    (tmp_path / "site.toml").write_text(SITE)
    (tmp_path / "cart.toml").write_text(TWIN + "editable = []\n")
    (tmp_path / "store").mkdir()
    plan = read_site(tmp_path / "site.toml").twins[0]
    with closing(AtWork(plan, tmp_path / "store")) as work:
        cart = Beside(work, seed)
        cart.drive(300, 1.0)
        first = cart.drive(150, 1.6)["alarm"]
        said = next(e for e in cart.log if e["number"] == first["event"])["reason"]
        assert cart.drive(500, 1.0)["condition"] == "good"
        before = cart.drive(150, 0.6)
        assert before["alarm"]["since"] > first["since"]
        assert " is " in said and " is " not in cart.condition.in_past(said)
    with closing(AtWork(plan, tmp_path / "store")) as work:
        again = Condition({"log": math.inf}, asked=True)
        again.came("log")
        again.recalled((event for _, event in work.before), work.looks)
        again.looked(work.now)
        told = again.told(failed=False)
        assert told["alarm"]["event"] == before["alarm"]["event"]
        assert told["alarm"]["since"] > first["since"]
        assert told["returned"]["event"] == first["event"] and " is " not in again.in_past(said)
        assert abs(told["returned"]["over"] - before["returned"]["over"]) < 10 * 10**9


def test_a_run_that_begins_anew_is_judged_by_its_own_rows() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.came("log")
    frozen = {"cause": "frozen", "onset": 8000, "end": 9000}
    condition.heard(event(1, "measurement_error", "frozen", signal="y", row=9000, evidence=frozen))
    condition.heard(event(2, "abnormal", "x looks off by 3 K", row=9100))
    condition.heard(event(3, "started", "run 2", row=0))
    condition.looked(Now("held", first=10, since=7))
    told = condition.told(failed=False)
    assert (told["condition"], told["refused"], told["alarm"]) == ("good", [], None)
    assert condition.in_past("X looks off by 3 K.") == "X looked off by 3 K."


@first_of("seed", range(5))
def test_a_frozen_sensor_is_what_is_said_while_it_lasts_and_what_is_over(
    tmp_path: Path, seed: int
) -> None:
    """The rows that it gave before it was found out tell nothing of the machine."""
    (tmp_path / "site.toml").write_text(SITE)
    (tmp_path / "cart.toml").write_text(TWIN + "editable = []\n")
    (tmp_path / "store").mkdir()
    with closing(AtWork(read_site(tmp_path / "site.toml").twins[0], tmp_path / "store")) as work:
        cart = Beside(work, seed)
        assert cart.drive(400, 1.0)["condition"] == "good"
        while abs(cart.v) > 0.2:  # it freezes within the tolerance of where it is
            cart.drive(10, 1.0)
        stays = cart.x
        while "measurement_error" not in cart.kinds:
            cart.drive(10, 1.0, stays)
        for _ in range(8):
            told = cart.drive(10, 1.0, stays)
            assert (told["condition"], told["alarm"]) == ("maintenance_required", None)
            assert "frozen" in told["why"]
        for _ in range(30):
            told = cart.drive(10, 1.0)
        assert (told["condition"], told["refused"]) == ("good", [])
        assert told["returned"]["reason"] == "x: frozen while the model predicted motion"
        assert cart.heard[told["returned"]["event"]] == "measurement_error"


def test_a_later_fit_hides_no_interval_of_the_live_version(tmp_path: Path) -> None:
    (tmp_path / "site.toml").write_text(SITE)
    (tmp_path / "cart.toml").write_text(TWIN)
    (tmp_path / "store").mkdir()
    with closing(AtWork(read_site(tmp_path / "site.toml").twins[0], tmp_path / "store")) as work:
        Beside(work, 1).drive(900, 1.6)
        live = {one["name"]: one for one in work.about["parameters"]}["gain"]
        assert work.about["champion"] and live["interval95"] and live["verdict"]
        later = Estimate(899, 0, 1, "gain", 1.7, 1.6, 1.8, "identifiable", 0, 0)
        work.twin._ledger.commit(Batch([later]))
        work._news()
        assert live in work.about["parameters"]


def event(number: int, kind: str, reason: str = "", **more: Any) -> dict[str, Any]:
    return {"number": number, "kind": kind, "reason": reason, "row": 10 * number,
            "time": number, "signal": "", "evidence": {}, **more}  # fmt: skip


def test_what_two_signals_say_of_each_other_is_not_over_because_one_looks_sound() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.came("log")
    compared = {"cause": "kinematics", "open": True}
    condition.heard(event(1, "measurement_error", "57 times", signal="q", evidence=compared))
    condition.heard(event(2, "measurement_restored", signal="q", evidence={"cause": "range"}))
    assert condition.told(failed=False)["refused"] == ["q"]
    condition.heard(event(3, "measurement_restored", signal="q", evidence=compared))
    assert condition.told(failed=False)["refused"] == []


def test_a_sensor_that_lies_is_not_good_until_it_is_believed_again() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.came("log")
    frozen = {"cause": "frozen", "onset": 3, "end": 10}
    lies = event(1, "measurement_error", "frozen", signal="x", evidence=frozen)
    condition.heard(lies)
    told = condition.told(failed=False)
    assert told["condition"] == "maintenance_required" and told["refused"] == ["x"]
    assert told["why"] == "look at the sensor of x: frozen"
    condition.heard(event(2, "measurement_restored", signal="x"))
    assert condition.told(failed=False)["condition"] == "good"
    condition.heard(lies | {"evidence": frozen | {"cause": "vote"}})  # one sample, and over
    condition.heard(lies | {"row": 40})
    assert condition.told(failed=False)["condition"] == "good"


def test_a_word_on_what_is_out_and_on_what_is_over() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.came("log")
    condition.heard(event(3, "suspected", "x is off"))
    condition.heard(event(4, "labelled", evidence={"event": 9, "verdict": "false alarm"}))
    assert condition.told(failed=False)["condition"] == "out_of_specification"  # of another event
    condition.heard(event(4, "abnormal", "x is off"))
    condition.heard(event(4, "labelled", evidence={"event": 3, "verdict": "false alarm"}))
    condition.looked(Now("off", "x is off by more", "x", 1, 1, 2))
    assert condition.told(failed=False)["condition"] == "good"  # as a person said
    condition.heard(event(5, "suspected", "x is off anew"))
    assert condition.told(failed=False)["condition"] == "out_of_specification"
    condition.looked(Now("held", first=40, since=1))  # rows from before the newest word on it
    assert condition.told(failed=False)["condition"] == "out_of_specification"
    condition.looked(Now("held", first=51, since=7))
    told = condition.told(failed=False)
    said = "X is off anew. Still, y is off."
    assert condition.in_past(said) == "X was off anew. Still, y is off."
    assert told["returned"]["over"] == 7 and told["returned"]["label"] == ""
    condition.heard(event(6, "labelled", evidence={"event": 5, "verdict": "acknowledged"}))
    assert condition.told(failed=False)["returned"]["label"] == "acknowledged"


def test_what_was_over_stays_in_the_past_however_often_something_else_is_out() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.heard(event(3, "abnormal", "x looks off by +1.5 K", signal="x"))
    condition.heard(event(4, "suspected", "y is off", signal="y"))
    condition.looked(Now("held", first=41, since=4))
    for k in range(5, 45):
        condition.looked(Now("off", f"y is off by {k} K", "y", 10 * k, k, k))
        assert condition.in_past("X looks off by +1.5 K.") == "X looked off by +1.5 K."
        condition.looked(Now("held", first=10 * k + 1, since=k))
    condition.heard(event(46, "abnormal", "x looks off by +1.5 K", signal="x"))
    assert condition.in_past("X looks off by +1.5 K.") == "X looks off by +1.5 K."


def test_what_was_said_of_a_channel_and_is_refuted_is_over() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.came("log")
    condition.heard(event(3, "abnormal", "the sign of x looks turned", signal="x"))
    condition.heard(event(4, "normal", "y: fouling explains it", signal="y"))
    assert condition.told(failed=False)["condition"] == "out_of_specification"
    condition.heard(
        event(5, "normal", "x is in doubt no longer", signal="x", evidence={"doubt": "x"})
    )
    assert condition.told(failed=False)["returned"]["reason"] == "the sign of x looked turned"


def test_what_no_event_has_told_of_names_none() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.heard(event(126, "tuned"))
    condition.looked(Now("off", "x is off", "x", 1, 1, 2))
    assert condition.told(failed=False)["alarm"]["event"] is None
    condition.heard(event(127, "promoted"))
    assert condition.told(failed=False)["returned"]["event"] is None
    condition.heard(event(128, "labelled", evidence={"event": 127, "verdict": "false alarm"}))
    assert condition.told(failed=False)["returned"]["label"] == ""


def test_samples_that_are_trusted_again_end_what_was_not_valid_of_their_signal_alone() -> None:
    condition = Condition({"log": math.inf}, asked=True)
    condition.came("log")
    condition.heard(event(3, "not_valid", "no trusted sample within the time-out", signal="x"))
    condition.heard(event(4, "valid", signal="y"))
    condition.looked(Now("held", first=51, since=7))
    assert condition.told(failed=False)["why"] == "x: no trusted sample within the time-out"
    condition.heard(event(5, "valid", signal="x"))
    assert condition.told(failed=False)["condition"] == "good"


def test_what_is_over_is_told_in_the_past() -> None:
    said = "speed looks off by +60 rpm: sensor or machine, that cannot be told; x is still off"
    assert past(said) == (
        "speed looked off by +60 rpm: sensor or machine, that could not be told; x was still off"
    )
    assert past("thesis.is 5 is-not") == "thesis.is 5 is-not"
