"""``life --json`` and ``plan --json`` word by word: fields, types, and no NaN or Infinity."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from .conftest import TWIN, Command

AMOUNT = {"type": "number", "minimum": 0.0}
OPEN = {"type": ["number", "null"], "minimum": 0.0}
"""null: without end."""
INTERVAL = {"type": "array", "prefixItems": [OPEN, OPEN], "minItems": 2, "maxItems": 2}
LIFE = {
    "type": "object",
    "required": ["median", "interval80", "interval95", "not_before", "unit", "passed_at", "failed",
                 "pace", "dates"],
    "properties": {
        "median": OPEN, "interval80": INTERVAL, "interval95": INTERVAL, "not_before": OPEN,
        "unit": {"enum": ["run", "cycle", "s", "h", "d"]},
        "passed_at": {"type": ["number", "null"]},
        "failed": {"type": "boolean"},
        "pace": {"type": ["number", "null"], "exclusiveMinimum": 0.0},
        "dates": {"type": ["object", "null"]},
    },
    "additionalProperties": False,
}  # fmt: skip
LACKS = {
    "type": "object", "required": ["verdict", "needs"], "additionalProperties": False,
    "properties": {
        "verdict": {"const": "not enough data"}, "needs": {"type": "string", "minLength": 1},
    },
}  # fmt: skip
COMPONENT = {
    "type": "object",
    "required": ["indicator", "unit", "value", "limit", "law", "life", "probability_before"],
    "properties": {
        "indicator": {"type": "string"}, "unit": {"type": "string"},
        "value": {"type": ["number", "null"]}, "limit": {"type": "number"},
        "direction": {"enum": ["above", "below"]}, "limit_source": {"type": "string"},
        "law": {"type": ["string", "null"]},
        "laws": {"type": "object", "additionalProperties": AMOUNT},
        "life": {"oneOf": [LIFE, LACKS]},
        "probability_before": {
            "type": ["object", "null"],
            "additionalProperties": {"type": "number", "minimum": 0.0, "maximum": 1.0},
        },
    },
}  # fmt: skip
SCHEMA = {
    "type": "object",
    "required": ["schema", "components", "machine", "alarms", "notes"],
    "properties": {
        "schema": {"const": "evertwin.life/1"},
        "components": {"type": "object", "minProperties": 1, "additionalProperties": COMPONENT},
        "machine": {"oneOf": [LIFE, LACKS, {"type": "null"}]},
        "alarms": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["component", "kind", "reason", "interval", "evidence", "action"],
            },
        },
        "notes": {"type": "array", "items": {"type": "string"}},
    },
}  # fmt: skip
INDICATOR = """
[[indicator]]
name = "friction"
component = "gearbox"
unit = "Nm"
limit = 18
[prognosis]
ahead = "30 run"
[prognosis.components.gearbox]
failure = FAILURE
maintenance = 900
"""


def strict(text: str) -> Any:
    """The document, as a parser reads it that knows no NaN and no Infinity."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} in a JSON document")

    return json.loads(text, parse_constant=refuse)


def grown(seed: int, growth: float, noise: float) -> list[float]:
    rng = np.random.default_rng(seed)
    return [12.0 + growth * k + noise * rng.normal() for k in range(40)]


SERIES = {
    "growth": grown(1, 0.1, 0.1),
    "growth that does not stand out": grown(6, 0.006, 0.15),
    "too little": [12.0, 12.1],
    "constant": [12.0] * 20,
    "over at once": [20.0 + 0.01 * k for k in range(10)],
    "empty cells": [float("nan")] * 8,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", SERIES)
def test_the_documents_keep_their_schema(kind: str, folder: Path, call: Command) -> None:
    (folder / "robot.toml").write_text(TWIN + INDICATOR.replace("FAILURE", "1000"))
    rows = [f"{k + 1},{'' if np.isnan(x) else round(x, 4)}" for k, x in enumerate(SERIES[kind])]
    (folder / "h.csv").write_text("run,friction\n" + "\n".join(rows) + "\n")
    content = strict(call("life", "robot.toml", "--history", "h.csv", "--json").out)
    jsonschema.validate(content, SCHEMA)
    one = content["components"]["gearbox"]
    told = "median" in one["life"]
    assert told == (kind in ("growth", "over at once"))
    assert (one["probability_before"] is None) == (not told)
    if kind == "growth":
        assert one["law"] in one["laws"] and list(one["probability_before"]) == ["30"]
        assert one["life"]["interval95"][1] > one["life"]["interval80"][1] > one["life"]["median"]
    if kind == "over at once":
        assert one["life"]["median"] == 0.0 and one["life"]["passed_at"] == 1.0
    planned = strict(call("plan", "robot.toml", "--history", "h.csv", "--json").out)
    assert planned["schema"] == "evertwin.plan/1"
    dated = [item["component"] for item in planned["items"]]
    assert dated == (["gearbox"] if told else []) and set(planned["without_date"]) == (
        set() if told else {"gearbox"}
    )


def test_a_series_alone_tells_its_life(folder: Path, call: Command) -> None:
    rng = np.random.default_rng(0)
    rows = [f"{k},{1.9 - 0.004 * k + 0.002 * rng.normal():.5f}" for k in range(80)]
    (folder / "cell.csv").write_text("cycle,capacity\n" + "\n".join(rows) + "\n")
    told = strict(call("life", "cell.csv", "--limit", "1.4", "--below", "--json").out)
    jsonschema.validate(told, SCHEMA)
    life = told["components"]["capacity"]["life"]
    assert life["interval80"][0] < 46.0 < life["interval80"][1] and told["clock"] == "cycle"
    assert call("life", "cell.csv", "--limit", "1.4", "--below", "--check").code == 0
    wrong = call("life", "cell.csv", "--limit", "1.4")
    assert wrong.code == 4 and "cell.csv:2" in wrong.err and "--below" in wrong.err
    far = call("life", "cell.csv", "--limit", "1400", "--below")
    assert far.code == 4 and "in another unit" in far.err
    assert call("life", "cell.csv").code == 2
    none = call("life", "cell.csv", "--limit", "1.4", "--below", "--fleet", "none/*.csv")
    assert none.code == 2 and "none/*.csv" in none.err
    itself = call("life", "cell.csv", "--limit", "1.4", "--below", "--fleet", "cel*.csv")
    assert itself.code == 2 and "got cell.csv alone" in itself.err


def test_a_series_alone_is_reported_and_refuses_what_is_of_a_twin(
    folder: Path, call: Command
) -> None:
    for seed in range(2):
        rows = [f"2025-{1 + k // 28:02d}-{1 + k % 28:02d},{x}" for k, x in
                enumerate(grown(seed, 0.1, 0.1))]  # fmt: skip
        (folder / "h.csv").write_text("date,friction\n" + "\n".join(rows) + "\n")
        known = ("life", "h.csv", "--limit", "18", "--json")
        report = folder / f"r{seed}.html"
        assert call(*known, "--report", report.name).json == call(*known).json
        text = report.read_text()
        assert "h.csv" in text and "course, median" in text and "<svg" in text
    for option in ("--history", "--data"):
        wrong = call(*known, option, "h.csv")
        assert wrong.code == 2 and f"{option}" in wrong.err and "a series alone" in wrong.err


def test_a_fleet_is_named_on_the_command_line(folder: Path, call: Command) -> None:
    rng = np.random.default_rng(1)
    for name, life in (("a", 100), ("b", 110), ("c", 120), ("d", 105), ("own", 60)):
        whole = 110 if name == "own" else life
        y = 1.0 + np.arange(life + (0 if name == "own" else 4)) / whole
        text = "\n".join(f"{k},{v + 0.01 * rng.normal():.5f}" for k, v in enumerate(y))
        (folder / f"{name}.csv").write_text(f"run,wear\n{text}\n")
    known = ("life", "own.csv", "--limit", "2", "--json")

    def interval(*more: str) -> list[float]:
        document = strict(call(*known, *more).out)
        told: list[float] = document["components"]["wear"]["life"]["interval80"]
        return told

    alone, fleet = interval(), interval("--fleet", "[abcd].csv")
    assert interval("--fleet", *(f"{name}.csv" for name in "abcd")) == fleet  # as a shell spells it
    assert fleet[0] < 51.0 < fleet[1] and np.ptp(fleet) < 0.5 * np.ptp(alone)


@pytest.mark.parametrize(
    ("head", "step", "says"),
    [
        ("cycle,capacity", "{k}", "capacity by cycle, 40 rows"),
        ("date,capacity", "2025-01-{d:02d}T{h:02d}:00", "capacity by h, 40 rows"),
        ("index,date,capacity", "{k},2025-01-{d:02d}T{h:02d}:00", "capacity by h, 40 rows"),
    ],
)
def test_init_of_a_series_that_tells_wear_names_its_command(
    head: str, step: str, says: str, folder: Path, call: Command
) -> None:
    rows = [f"{step.format(k=k, d=1 + k // 24, h=k % 24)},{1.9 - 0.004 * k:.4f}" for k in range(40)]
    (folder / "cell.csv").write_text(head + "\n" + "\n".join(rows) + "\n")
    told = call("init", "cell.csv")
    assert told.code == 0 and says in told.out
    assert told.out.rstrip().endswith("next: evertwin life cell.csv --limit X --below")
    assert call("init", "cell.csv", "-o", "t.toml").code == 0 and not (folder / "t.toml").exists()
    document = strict(call("init", "cell.csv", "--json").out)
    assert document["next"] == "evertwin life cell.csv --limit X --below"


def test_init_of_a_recording_hints_at_wear_where_it_may_be(folder: Path, call: Command) -> None:
    rows = [f"{600 * k},{k + np.sin(k):.4f},{np.cos(k):.4f}" for k in range(40)]
    (folder / "plant.csv").write_text("t,u,y\n" + "\n".join(rows) + "\n")
    told = call("init", "plant.csv", "-o", "plant.toml")
    assert told.code == 0 and (folder / "plant.toml").exists()
    assert "evertwin life plant.csv --column u --limit X" in told.err
    swings = [f"{600 * k},{np.sin(k):.4f},{np.cos(k):.4f}" for k in range(40)]
    (folder / "swings.csv").write_text("t,u,y\n" + "\n".join(swings) + "\n")
    assert "life" not in call("init", "swings.csv", "-o", "swings.toml").err
    fast = [f"{0.01 * k},{np.sin(k):.4f},{np.cos(k):.4f}" for k in range(40)]
    (folder / "axis.csv").write_text("t,u,y\n" + "\n".join(fast) + "\n")
    assert "life" not in call("init", "axis.csv", "-o", "axis.toml").err
    again = call("init", "axis.csv")  # writes axis.toml, which is there
    assert again.code == 2 and "axis.toml: exists already" in again.err


def test_a_limit_is_in_the_unit_of_the_heading(folder: Path, call: Command) -> None:
    rows = [f"{k},{12.0 - 0.2 * k + 0.01 * np.sin(9 * k):.3f}" for k in range(30)]
    (folder / "pad.csv").write_text("cycle,thickness [mm]\n" + "\n".join(rows) + "\n")
    told = call("life", "pad.csv", "--limit", "3", "--below")
    assert told.code == 0 and "limit 3 mm" in told.out, told.err
