"""Texts within bounds: what is too deep, too long or too large ends in one line, at once."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from evertwin.config import reads
from evertwin.errors import ConfigError
from evertwin.settings.document import Document
from evertwin.settings.lines import Lines

HEAD = 'schema = 1\nname = "axis"\nmodel = { kind = "drive" }\n'
HUGE = {
    "nested arrays": (HEAD + "[tuning]\nladder = " + "[" * 2_000 + "]" * 2_000, 5),
    "nested tables": (HEAD + "x = " + "{a=" * 2_000 + "1" + "}" * 2_000, 4),
    "dotted key": (HEAD + ".".join("a" * 100_000) + " = 1", 4),
    "dotted heading": (HEAD + "[" + ".".join("a" * 100_000) + "]", 4),
    "headings below one another": (
        HEAD + "".join(f"[{'.'.join('a' * k)}]\n" for k in range(1, 40)), 37,
    ),
    "digits": (HEAD + "beat = " + "9" * 500, 4),
    "five thousand digits": (HEAD + "[trial]\nlimit = " + "9" * 5_000, 5),
    "large whole number": (HEAD + "beat = 1" + "0" * 390, 4),
    "large hexadecimal": (HEAD + "beat = 0x" + "f" * 300, 4),
    "array": (HEAD + "[tuning]\nladder = [\n" + "'a',\n" * 20_000 + "]", 5),
    "keys": (HEAD + "[tuning.weights]\n" + "".join(f"k{i} = 1\n" for i in range(20_000)), 4),
    "sources": (HEAD + "[[source]]\n" * 20_000, 4),
    "window": (HEAD + "[tuning]\nwindow = 1_000_000_000_000", 5),
    "window in time": (HEAD + "[clock]\nrate = '1 kHz'\n[tuning]\nwindow = '1 week'", 7),
    "vote": (HEAD + "[arbiter]\nvote = 1_000_000_000_000", 5),
    "vote as a float": (HEAD + "[arbiter]\nvote = 1e12", 5),
    "workers": (HEAD + "[tuning]\nworkers = 10_000", 5),
    "rate": (HEAD + "[clock]\nrate = '1e300 Hz'", 5),
    "pattern": (HEAD + '[tuning.weights]\n"k{1..999999999}" = 1', 5),
    "pattern in a pattern": (
        HEAD + '[tuning.causes]\n"a{1..5000}" = []\n"b{1..5000}" = []\n"c{1..5000}" = []', 7,
    ),
}  # fmt: skip


LARGEST = HEAD + "[tuning]\nladder = [\n" + "'a',\n" * 10_000 + "]"
READ = """
import json, sys, time
from evertwin.config import reads
from evertwin.errors import ConfigError
found = {}
for case, text in json.load(sys.stdin).items():
    begin, said = time.process_time(), ""
    try:
        reads(text, "f")
    except ConfigError as error:
        said = str(error)
    found[case] = [said, time.process_time() - begin]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def read() -> dict[str, tuple[str, float]]:
    """Case → what is said, and how long it took; in a process where no call is checked."""
    texts = {case: text for case, (text, _) in HUGE.items()} | {"largest": LARGEST}
    done = subprocess.run(
        [sys.executable, "-c", READ], input=json.dumps(texts), capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    found: dict[str, tuple[str, float]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("case", HUGE)
def test_what_is_too_large_ends_in_one_line_at_once(
    case: str, read: dict[str, tuple[str, float]]
) -> None:
    said, seconds = read[case]
    assert said.startswith(f"f:{HUGE[case][1]}: "), said
    assert len(said) < 400
    assert "\n" not in said
    assert seconds < 1.5


def test_the_largest_arrays_are_read_at_once(read: dict[str, tuple[str, float]]) -> None:
    said, seconds = read["largest"]
    assert not said
    assert seconds < 1.5


def test_a_text_too_long_for_a_twin_file_is_not_read() -> None:
    with pytest.raises(ConfigError, match="f: over 300000 characters: expected a twin file"):
        reads(HEAD + "# " + "x" * 300_000, "f")


def test_lines_survive_long_values_and_quoted_keys() -> None:
    text = (
        'a = """\nb = 1\n"""\n"c d".e = [\n  1, # x\n]\n[t."u.v"]\nf = { g = 1 }\n[[s]]\n[[s]]\nh=1'
    )
    lines = Lines(text)
    assert [lines.of(p) for p in (("a",), ("c d", "e"), ("t", "u.v", "f"), ("s", 1, "h"))] == [
        1, 4, 8, 11,
    ]  # fmt: skip
    assert lines.of(("t", "u.v", "f", "g")) == 8


def test_lines_of_what_stands_in_an_array() -> None:
    text = (
        "components = [\n  { name = 'a' },\n  # none\n  { name = 'b',\n    kind = 'c' },\n]\nx = 1"
    )
    lines = Lines(text)
    places = [("components", 0), ("components", 1), ("components", 1, "kind"), ("x",)]
    assert [lines.of(place) for place in places] == [2, 4, 5, 7]


def test_a_document_keeps_its_lines() -> None:
    document = Document('[t]\n"a{1..2}" = { b = "{3, 4}" }\nc = ["d{1..2}",\n "e"]', "f")
    assert document.table == {"t": {"a1": {"b": 3}, "a2": {"b": 4}, "c": ["d1", "d2", "e"]}}
    assert document.line(("t", "a2", "b")) == 2
    assert document.line(("t", "c", 1)) == 3
    assert document.line(("t", "c", 2)) == 4
