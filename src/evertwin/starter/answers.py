"""What a person answers to the questions of a first twin file, before it is written.

What is proposed rests on the answers: times on the rate of the rows, a requirement on the column.

>>> answers_of(["log.rate=100 Hz", "u.column=vm"])
{('log', 'rate'): '100 Hz', ('u', 'column'): 'vm'}
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

from evertwin.errors import UsageError
from evertwin.models import Model
from evertwin.settings.quantity import as_number, in_unit
from evertwin.sources.columns.description import ColumnInfo
from evertwin.sources.columns.names import listed
from evertwin.starter.channels.named import unit_of
from evertwin.starter.looks.seen import Seen
from evertwin.starter.proposal import ASK, Match, Proposal

WHAT, MODEL = ("rate", "column", "scale", "value"), "model"
Answers: TypeAlias = Mapping[tuple[str, str], str]
"""(what is asked about, what of it) → the answer."""


def answers_of(texts: Sequence[str]) -> Answers:
    """Answers as a command line gives them.

    Raises:
        UsageError: one is none.
    """
    out = dict[tuple[str, str], str]()
    for text in texts:
        asked, equals, said = text.partition("=")
        name, _, what = asked.strip().rpartition(".")
        if not (equals and name and said.strip()) or (what not in WHAT and name != MODEL):
            raise UsageError(
                f"--answer {text}: expected NAME.WHAT=ANSWER, where WHAT is one of "
                f"{', '.join(WHAT)}, as in log.rate='100 Hz' or u.column=pump"
            )
        out[name, what] = said.strip()
    return out


def with_options(options: Mapping[str, Any], answers: Answers) -> dict[str, Any]:
    """Options of a model, with what was said of those that are asked, as a twin file has it.

    >>> with_options({"wheel_base": "?"}, {("model", "wheel_base"): "1.2 m"})
    {'wheel_base': 1.2}

    Raises:
        UsageError: no such option is asked.
    """
    out = dict(options)
    for (name, what), said in answers.items():
        if name == MODEL:
            if out.get(what) != ASK:
                asked = [one for one, value in out.items() if value == ASK]
                raise UsageError(
                    f"--answer model.{what}: the model asks no such thing: expected "
                    f"{listed(asked) or 'no answer of that kind'}"
                )
            out[what] = _value(said)
    return out


def _value(said: str) -> Any:
    if said in ("true", "false"):
        return said == "true"
    try:
        return float(said)
    except ValueError:
        return as_number(said)


def with_rates(seen: Sequence[Seen], answers: Answers) -> tuple[Seen, ...]:
    """Tables without stamps, with the time from row to row that was said.

    Raises:
        UsageError: no such table asks, or the answer is no rate.
    """
    out = list(seen)
    for (name, what), said in answers.items():
        if what != "rate":
            continue
        asked = [
            k for k, one in enumerate(out) if one.period is None and name in ("log", one.about)
        ]
        if not asked:
            raise UsageError(
                f"--answer {name}.rate: no table of that name lacks the time of its rows"
            )
        rate = in_unit(f"--answer {name}.rate", said, "Hz")
        if not rate > 0.0:
            raise UsageError(f"--answer {name}.rate: expected a rate above 0, got {said}")
        for k in asked:
            out[k] = replace(out[k], every=1.0 / rate)
    return tuple(out)


def with_answers(
    found: Proposal, model: Model | None, seen: Sequence[Seen], answers: Answers
) -> Proposal:
    """The proposal, with columns and numbers as they were answered.

    Raises:
        UsageError: a channel or a column is none, or the column feeds another channel.
    """
    units = {c.name: c.unit for c in (*model.inputs, *model.outputs)} if model else {}
    matches = {match.channel: match for match in found.matches}
    derived = {one.name: one for one in found.derivations}
    for (name, what), said in answers.items():
        where = f"--answer {name}.{what}"
        if what == "column" and (name in matches or name in found.missing):
            matches[name] = _column(where, name, said, units.get(name), seen)
        elif what == "scale" and name in matches:
            matches[name] = replace(matches[name], scale=in_unit(where, said, ""))
        elif what == "value" and name in derived:
            derived[name] = replace(derived[name], value=in_unit(where, said, ""))
        elif what != "rate" and name != MODEL:
            could = [*matches, *found.missing, *derived]
            raise UsageError(
                f"{where}: there is no such {what}: expected one of {listed(could, 8)}"
            )
    for match in matches.values():
        twice = [m.channel for m in matches.values() if _place(m) == _place(match)]
        if len(twice) > 1 and any((name, "column") in answers for name in twice):
            raise UsageError(
                f"{' and '.join(twice)} have one column, {match.column}: answer both, as in "
                f"--answer {twice[0]}.column=…"
            )
    feeds = {_place(match) for match in matches.values()}
    rest = (c.name for s, one in enumerate(seen) for c in one.columns if (s, c.name) not in feeds)
    lacking = tuple(name for name in found.missing if name not in matches)
    return Proposal(tuple(matches.values()), tuple(derived.values()), lacking, tuple(rest))


def _place(match: Match) -> tuple[int, str]:
    return match.source, match.column


def _column(where: str, channel: str, said: str, unit: str | None, seen: Sequence[Seen]) -> Match:
    """The column of that name as a channel's; of a model of one's own in the unit it states."""
    for s, column in _columns(seen):
        if column.name == said:
            own, scale, _ = unit_of(unit, column) if unit else (column.unit or "1", 1.0, "")
            return Match(channel, s, said, own, "as answered", scale)
    raise UsageError(
        f"{where}: there is no column {said!r}: expected one of "
        f"{listed([column.name for _, column in _columns(seen)], 8)}"
    )


def _columns(seen: Sequence[Seen]) -> Iterator[tuple[int, ColumnInfo]]:
    return ((s, column) for s, one in enumerate(seen) for column in one.columns)
