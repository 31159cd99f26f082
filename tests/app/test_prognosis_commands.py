"""forecast, life, whatif, plan on the command line: documents, decisions, findings, the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evertwin.store import SqliteStore

from .conftest import TWIN, Command

MORE = """
[[indicator]]
name = "friction"
component = "gearbox"
unit = "Nm"
limit = 18

[prognosis.components.gearbox]
failure = 9000
maintenance = 900

[prognosis]
windows = 10
ahead = "30 run"
"""


@pytest.fixture
def worn(folder: Path) -> Path:
    (folder / "robot.toml").write_text(TWIN + MORE)
    rng = np.random.default_rng(1)
    rows = [f"{k + 1},{12.0 + 0.1 * k + rng.normal(0.0, 0.1):.4f},{'' if k else 'new'}"
            for k in range(40)]  # fmt: skip
    (folder / "friction.csv").write_text("run,friction,maintenance\n" + "\n".join(rows) + "\n")
    return folder


def test_forecast_gives_its_document(call: Command) -> None:
    done = call("forecast", "robot.toml", "--data", "robot.csv", "--horizon", "5 s", "--json")
    content = done.json
    assert done.code == 0 and content["schema"] == "evertwin.forecast/1"
    x = content["outputs"]["x"]
    assert len(content["t"]) == len(x["value"]) == 50 and x["unit"] == "m"
    assert x["low95"][-1] < x["low80"][-1] < x["value"][-1] < x["high80"][-1] < x["high95"][-1]
    text = call("forecast", "robot.toml", "--data", "robot.csv", "--as", "hold")
    assert text.code == 0 and "60 s ahead, inputs: hold" in text.out
    assert call("forecast", "robot.toml", "--data", "robot.csv", "--horizon", "5 kg").code == 2


def test_a_plan_is_shortened_and_stands_alone(folder: Path, call: Command) -> None:
    (folder / "next.csv").write_text("t,v\n" + "".join(f"{k / 10},0.1\n" for k in range(50)))
    told = ("forecast", "robot.toml", "--data", "robot.csv", "--inputs", "next.csv")
    assert len(call(*told, "--json").json["t"]) == 50
    short = call(*told, "--horizon", "2 s", "--json").json
    assert len(short["t"]) == 20 and short["inputs"] == "planned"
    both, far = call(*told, "--as", "hold"), call(*told, "--horizon", "9 s")
    assert both.code == far.code == 2
    assert "either --inputs or --as" in both.err and "at most 5 s" in far.err


def test_life_gives_its_document(worn: Path, call: Command) -> None:
    done = call("life", "robot.toml", "--history", "friction.csv", "--json")
    content = done.json
    assert done.code == 0 and content["schema"] == "evertwin.life/1"
    one = content["components"]["gearbox"]
    assert set(one) >= {"indicator", "value", "limit", "law", "life", "probability_before"}
    assert set(one["life"]) >= {"median", "interval80", "interval95", "unit"}
    assert one["life"]["median"] == pytest.approx(20.0, abs=6.0) and one["limit"] == 18
    short = worn / "short.csv"
    short.write_text("run,friction\n1,12\n2,12.1\n")
    life = call("life", "robot.toml", "--history", "short.csv", "--json").json
    assert life["components"]["gearbox"]["life"]["verdict"] == "not enough data"
    assert "values" in life["components"]["gearbox"]["life"]["needs"]


def test_check_finds_what_is_due(worn: Path, call: Command) -> None:
    assert call("life", "robot.toml", "--history", "friction.csv", "--check").code == 1
    calm = TWIN + MORE.replace("limit = 18", "limit = 60")
    (worn / "robot.toml").write_text(calm)
    assert call("life", "robot.toml", "--history", "friction.csv", "--check").code == 0


@pytest.mark.slow
def test_plan_is_written_and_decisions_are_kept(worn: Path, call: Command) -> None:
    known = ("--history", "friction.csv")
    done = call("plan", "robot.toml", *known, "-o", "plan.csv", "--report", "r.html", "--json")
    content = done.json
    assert content["schema"] == "evertwin.plan/1"
    assert content["items"][0]["component"] == "gearbox" and content["items"][0]["window"] == 0
    assert (worn / "plan.csv").read_text().startswith("component,after,unit,window")
    page = (worn / "r.html").read_text()
    assert page.count("<svg") == 1 and 'class="date"' in page and "http" not in page
    assert [stop["components"] for stop in content["stops"]] == [["gearbox"]]
    late = call("decide", "robot.toml", "gearbox", "postpone", *known, "--when", "15",
                "--reason", "spare part late")  # fmt: skip
    assert late.code == 0, late.err
    again = call("plan", "robot.toml", *known, "-o", "plan.csv")
    assert again.code == 0 and "after 20 run (window 2)" in again.out and "postponed" in again.out
    for said in (("confirm", "--when", "nan"), ("postpone", "--when", "9"), ("withdraw",),
                 ("replaced", "--when", "1e9")):  # fmt: skip
        wrong = call("decide", "robot.toml", "gearbox", *said, *known)
        assert wrong.code == 2 and "expected" in wrong.err
    taken = call("decide", "robot.toml", "gearbox", "withdraw", "--reason", "it came")
    assert taken.code == 0 and call("plan", "robot.toml", *known).out.startswith("gearbox: after 0")
    assert call("decide", "robot.toml", "gearbox", "reject").code == 2
    unknown = call("decide", "robot.toml", "gearbox", "later")
    assert unknown.code == 2 and "expected one of confirm" in unknown.err
    done = call("decide", "robot.toml", "gearbox", "replaced", "--reason", "new gearbox", "--json",
                *known)  # fmt: skip
    assert done.json["event"]["reason"] == "new gearbox"
    assert done.json["event"]["evidence"]["at"] == 40.5
    listed = call("decide", "robot.toml", "--json").json["decisions"]
    assert [(one["verdict"], one["state"]) for one in listed] == [
        ("postponed", "withdrawn"), ("replaced", "holds")
    ]  # fmt: skip
    assert listed[0]["said_at"] == 40.0 and listed[0]["at"] == 55.0
    text = call("decide", "robot.toml").out
    assert "at run 40: gearbox: postponed until run 55: spare part late  [withdrawn]" in text
    assert call("decide", "robot.toml", "--when", "3").code == 2
    store = SqliteStore(worn / "robot.db", read_only=True)
    kinds = [event.kind for event in store.read("event")]  # type: ignore[union-attr]
    store.close()
    assert "postponed" in kinds and "maintained" in kinds


def test_a_plan_overwrites_plans_alone(worn: Path, call: Command) -> None:
    known = ("--history", "friction.csv", "-o")
    before = (worn / "robot.toml").read_text()
    refused = call("plan", "robot.toml", *known, "robot.toml")
    assert refused.code == 2 and "is no plan" in refused.err
    assert (worn / "robot.toml").read_text() == before
    (worn / "old.csv").write_text("something else")
    assert call("plan", "robot.toml", *known, "old.csv").code == 2
    (worn / "old.csv").write_text("")
    for _ in range(2):
        assert call("plan", "robot.toml", *known, "old.csv").code == 0
    assert (worn / "old.csv").read_text().startswith("component,after")


def test_a_decision_needs_a_store(worn: Path, call: Command) -> None:
    memory = (TWIN + MORE).replace('[store]\npath = "robot.db"\n', "")
    (worn / "robot.toml").write_text(memory)
    done = call("decide", "robot.toml", "gearbox", "replaced")
    assert done.code == 2 and "[store] path" in done.err


def test_whatif_gives_its_document_and_its_schema(worn: Path, call: Command) -> None:
    (worn / "s.toml").write_text(
        'schema = 1\nname = "slow"\n[parameters]\ngain = { factor = 0.5 }\n[limits]\nx = "1 mm"\n'
    )
    given = ("--scenario", "s.toml", "--data", "robot.csv", "--history", "friction.csv")
    done = call("whatif", "robot.toml", *given, "--json", "--check")
    content = done.json
    assert content["schema"] == "evertwin.whatif/1" and done.code == 1
    assert content["change"]["x"]["rms"] < 0.0 and content["findings"]
    assert call("schema", "--scenario").json["title"] == "evertwin scenario"
    (worn / "s.toml").write_text('schema = 1\nname = "slow"\n[paramters]\n')
    wrong = call("whatif", "robot.toml", *given)
    assert wrong.code == 2 and "s.toml:3" in wrong.err and "parameters" in wrong.err
