"""``evertwin confusions``: what a detector takes for what, simulated and real."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from evertwin.app.console import show
from evertwin.errors import UsageError
from evertwin.features.images.confusions import Cell, Confusions, Rate, confusions
from evertwin.features.images.labelled import Labelled, read_labelled
from evertwin.features.images.randomisation import Coverage, Lead, coverage, leads

TOLD = 5
"""Settings that are named for one confusion."""


def show_confusions(
    files: Sequence[Path], rule: tuple[float, float | None], most: int, as_json: bool, check: bool
) -> None:
    """``evertwin confusions``; ``rule``: the level, and the least probability of a label.

    Raises:
        UsageError: a level that is none, or another number of files.
    """
    level, least = rule
    if not 0.0001 < level < 1.0:
        raise UsageError(f"--level: expected a number above 0.0001 and below 1, got {level}")
    if most < 1:
        raise UsageError(f"--most: expected 1 or more, got {most}")
    if len(files) > 2:
        raise UsageError(f"confusions: expected one file or two, got {len(files)}")
    rows = read_labelled(files, least)
    found = confusions(rows, level)
    differing = tuple(cell for cell in found.cells if cell.differs)
    why, wide = leads(rows, differing, level), coverage(rows)
    advice = [_advice(cell, one, wide) for cell, one in zip(differing, why, strict=True)]
    content: dict[str, Any] = {
        "schema": "evertwin.confusions/1",
        "rows": {"simulated": int(rows.simulated.sum()), "real": int((~rows.simulated).sum())},
        "groups": None if found.groups is None else dict(zip(("simulated", "real"), found.groups)),
        "classes": list(rows.classes), "level": level, "differ": found.differ, "p": found.p,
        "verdict": _verdict(found),
        "simulated": [cell.to_dict() for cell in found.most(True, most)],
        "real": [cell.to_dict() for cell in found.most(False, most)],
        "cells": [
            {**cell.to_dict(), "settings": [lead._asdict() for lead in one], "advice": said}
            for cell, one, said in zip(differing, why, advice, strict=True)
        ],
        "coverage": [{**one._asdict(), "wide": one.wide} for one in wide],
        "alone": list(found.alone),
    }  # fmt: skip
    show(content, _text(rows, found, most, (advice, wide)), as_json)
    if check and found.differ:
        raise typer.Exit(1)


def _verdict(found: Confusions) -> str:
    if math.isnan(found.p):
        return "cannot be told: no truth that both sides have was ever taken for something else"
    told = f"at the level of {100 * found.level:g} % over all cells"
    if found.differ:
        count = sum(cell.differs for cell in found.cells)
        cells = f"{count} confusion{'s' if count > 1 else ''}"
        return f"simulation and reality differ in {cells} (p {_p(found.p)}; {told})"
    if found.smallest > found.level:
        more = "groups" if found.groups else "labels"
        return (
            f"cannot be told: so few {more} that no difference could be told {told} (p is "
            f"{found.smallest:.2g} at best)"
        )
    size = ""
    if not math.isnan(found.detectable):
        size = (
            f"; of the most frequent confusion a difference of {100 * found.detectable:.2g} points "
            "would be told in 4 of 5 cases"
        )
    return f"no difference found (p {_p(found.p)}; {told}){size}"


def _p(p: float) -> str:
    return "≤ 0.0001" if p <= 0.0001 else f"{p:.2g}"


def _advice(cell: Cell, why: Sequence[Lead], wide: Sequence[Coverage]) -> str:
    """What to draw more widely, and what says so."""
    real, sim = cell.real.share, cell.simulated.share
    name = f"{cell.truth} taken for {cell.label}"
    narrow = {one.setting: one for one in wide if not one.wide}
    if real < sim:
        begin = (
            f"{name}: more often simulated than real ({100 * sim:.1f} % against {100 * real:.1f} %)"
        )
        if not why:
            return f"{begin}: no column of the simulated rows tells what it comes from"
        ends = ", ".join(f"{_end(lead)} {lead.setting}" for lead in why[:TOLD])
        return f"{begin}: it comes at {ends}: draw these less, as far as reality has them not"
    begin = f"{name}: more often real than simulated ({100 * real:.1f} % against {100 * sim:.1f} %)"
    if why:
        ends = ", ".join(
            f"{lead.setting} towards {_end(lead)} values"
            + (f" (reality: {_reach(narrow[lead.setting])})" if lead.setting in narrow else "")
            for lead in why[:TOLD]
        )
        return f"{begin}: randomise {ends}: simulated, it comes there"
    if narrow:
        ends = ", ".join(f"{one.setting} ({_reach(one)})" for one in narrow.values())
        return f"{begin}: no setting is seen to cause it; too narrow are {ends}"
    return (
        f"{begin}: randomise what makes {cell.truth} look like {cell.label}; which setting that is "
        "cannot be told: the simulated rows have no column that it comes with"
    )


def _end(lead: Lead) -> str:
    return "high" if lead.rank > 0.5 else "low"


def _reach(one: Coverage) -> str:
    (a, b), (c, d) = one.measured, one.drawn
    return f"measured {a:.4g} … {b:.4g}, drawn {c:.4g} … {d:.4g}"


def _text(
    rows: Labelled, found: Confusions, most: int, told: tuple[list[str], Sequence[Coverage]]
) -> str:
    advice, wide = told
    lines = []
    for simulated, word in ((True, "simulated"), (False, "real")):
        n = int((rows.simulated == simulated).sum())
        groups = ""
        if found.groups is not None:
            groups = f" in {found.groups[0 if simulated else 1]} groups"
        lines += [f"{word}: the most frequent confusions of {n} labels{groups}"]
        lines += _table(found.most(simulated, most), simulated) or ["  none"]
    lines += ["", _verdict(found)]
    lines += [f"  {said}" for said in advice]
    for one in wide:
        enough = "wide enough" if one.wide else f"too narrow, {_reach(one)}"
        lines.append(
            f"  setting {one.setting}: {100 * one.share:.1f} % ({100 * one.low:.1f} … "
            f"{100 * one.high:.1f}) of the measured values inside the middle 95 % of those drawn, "
            f"{one.width:.2g} times as wide: {enough}"
        )
    if found.alone:
        lines.append(f"  not compared, since one side alone has them: {', '.join(found.alone)}")
    return "\n".join(lines)


def _table(cells: Sequence[Cell], simulated: bool) -> list[str]:
    """The confusions of one side beside the other's rate."""
    if not cells:
        return []
    wide = max(len("truth"), *(len(cell.truth) for cell in cells))
    narrow = max(len("taken for"), *(len(cell.label) for cell in cells))
    other = "real" if simulated else "simulated"
    lines = [
        f"  {'truth':{wide}}  {'taken for':{narrow}}  {'labels':>12}  {'share (95 %)':>22}  "
        f"{other:>22}  {'p':>8}"
    ]
    for cell in cells:
        mine, theirs = cell.simulated, cell.real
        if not simulated:
            mine, theirs = theirs, mine
        lines.append(
            f"  {cell.truth:{wide}}  {cell.label:{narrow}}  {f'{mine.hits} of {mine.of}':>12}  "
            f"{_share(mine):>22}  {_share(theirs):>22}  "
            f"{'-' if math.isnan(cell.p) else _p(cell.p):>8}{' !' if cell.differs else ''}"
        )
    return lines


def _share(rate: Rate) -> str:
    if math.isnan(rate.share):
        return "-"
    return f"{100 * rate.share:.1f} % ({100 * rate.low:.1f} … {100 * rate.high:.1f})"
