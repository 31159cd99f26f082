"""What a fleet tells beside levels: lives that are alike, paces, and how much few machines are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evertwin.prognosis.laws import (
    Indicator,
    Life,
    Limit,
    Maintenance,
    NotEnough,
    learn,
    predict_life,
)
from evertwin.prognosis.laws.plans.alarms import alarm_of

from .test_predicted_life import machine, told


def late(life: float, start: float, seed: int) -> Indicator:
    """Next to nothing until late; where it begins says nothing of its life."""
    at = np.linspace(0.0, 1.05 * life, 100)
    level = start + 0.1 * at / life + (at / life) ** 12
    value = level + 0.01 * np.random.default_rng(seed).standard_normal(100)
    return Indicator.of("wear", "mm", Limit(1.0), at, value).with_(name=f"m{seed}")


def test_lives_that_are_alike_count_more_than_levels_that_scatter() -> None:
    rng = np.random.default_rng(1)
    draw = [(200.0 * np.exp(0.03 * rng.standard_normal()), rng.uniform(0, 0.1)) for _ in range(24)]
    fleet = learn([late(life, start, k) for k, (life, start) in enumerate(draw[:12])])
    off = [
        np.log(told(late(life, start, seed).until(0.5 * life), fleet).median / (0.5 * life))
        for seed, (life, start) in enumerate(draw[12:], 100)
    ]
    assert np.mean(np.abs(off)) < 0.15


@pytest.mark.parametrize("rows", [20, 30, 50])
def test_a_fleet_of_few_rows_a_life_comes_late_to_no_level(rows: int) -> None:
    found = []
    for seed in range(4):
        rng = np.random.default_rng(seed)

        def straight(life: float, rng: np.random.Generator = rng) -> Indicator:
            at = np.arange(0.0, 1200.0, 1000.0 / rows)
            value = at / life + 0.005 * rng.standard_normal(len(at))
            return Indicator.of("wear", "mm", Limit(1.0), at, value)

        fleet = learn([straight(1000.0 * (1.0 + 0.02 * rng.standard_normal())) for _ in range(6)])
        for share in (0.3, 0.5, 0.7):
            part = straight(1000.0).until(1000.0 * share)
            left = 1000.0 - float(part.at[-1])
            life = told(part, fleet)
            found.append((life.median / left, life.interval80[0] <= left <= life.interval80[1]))
    assert np.median([ratio for ratio, _ in found]) == pytest.approx(1.0, abs=0.05)
    assert sum(inside for _, inside in found) >= 9


def test_a_run_in_is_no_level_that_like_machines_are_looked_up_at() -> None:
    rng = np.random.default_rng(4)

    def bearing(life: float, high: float) -> Indicator:
        at = np.linspace(0.0, 1.05 * life, 400)
        calm = 1.0 + high * np.exp(-at / (0.03 * life))
        value = calm + 2.0 * np.maximum(at / life - 0.6, 0.0) / 0.4
        return Indicator.of("rms", "g", Limit(3.0), at, value + 0.02 * rng.standard_normal(400))

    lives = 500.0 * np.exp(0.2 * rng.standard_normal(10))
    fleet = learn([bearing(life, rng.uniform(0.0, 0.2)) for life in lives])
    for share in (0.7, 0.8):
        life = told(bearing(500.0, 1.2).until(500.0 * share), fleet)
        assert life.interval80[0] <= 500.0 * (1.0 - share) <= life.interval80[1]
        assert life.median == pytest.approx(500.0 * (1.0 - share), rel=0.25)


@pytest.mark.parametrize("share", [0.2, 0.3])
def test_a_fleet_needs_two_values_of_a_machine(share: float) -> None:
    rng = np.random.default_rng(3)

    def pads(life: float) -> Indicator:
        at = np.arange(0.0, 1.3, 0.1) * 60000.0
        value = 12.0 - 9.0 * at / life + 0.1 * rng.standard_normal(len(at))
        return Indicator.of("pads", "mm", Limit(3.0, "below"), at, value)

    fleet = learn([pads(60000.0 * np.exp(0.1 * rng.standard_normal())) for _ in range(12)])
    few = pads(60000.0).until(60000.0 * share)
    life = predict_life(few, fleet=fleet)
    assert isinstance(life, Life)
    low, high = life.interval80
    assert low <= 60000.0 * (1.0 - share) <= high < 4.0 * low
    assert isinstance(predict_life(few.until(0.0), fleet=fleet), NotEnough)


def test_like_machines_that_began_worn_tell_no_pace() -> None:
    fleet = learn([late(200.0, 0.2, k) for k in range(8)])
    fresh = told(late(200.0, 0.0, 100).until(60.0), fleet)
    assert fresh.pace == pytest.approx(1.0)
    assert fresh.median < 200.0


def test_few_machines_tell_less_than_many_however_often_they_are_asked() -> None:
    whole = learn([machine(k) for k in range(8)])
    part, widths = machine(100).until(60.0), []
    for fleet in (whole, replace(whole, ways=whole.ways[:3])):
        low, high = told(part, fleet).interval80
        widths.append(np.log(high / low))
    assert widths[1] > 1.2 * widths[0]


def test_members_that_still_run_do_not_narrow_the_answer() -> None:
    held, widths = [], []
    for draw in range(3):  # one fleet of three says little of a share
        rng = np.random.default_rng(draw)
        lives = 100.0 * np.exp(0.3 * rng.standard_normal(20))
        every = [late(life, 0.0, 1000 * draw + k) for k, life in enumerate(lives)]
        running = [
            one.until(rng.uniform(0.3, 0.9) * life)
            for one, life in zip(every[3:13], lives[3:13], strict=True)
        ]
        alone, mixed = learn(every[:3]), learn([*every[:3], *running])
        for one, life in zip(every[13:], lives[13:], strict=True):
            for share in (0.3, 0.5):
                part = one.until(share * life)
                left = life - float(part.at[-1])
                answers = [told(part, fleet).interval80 for fleet in (alone, mixed)]
                held.append([low <= left <= high for low, high in answers])
                widths.append([np.log(high / low) for low, high in answers])
    by_few, by_all = np.mean(held, axis=0)
    assert by_all >= by_few - 0.1
    narrow, wide = np.median(widths, axis=0)
    assert wide > 0.75 * narrow


def rig(rng: np.random.Generator, fails: bool) -> Indicator:
    """A channel that is calm, or rises to about six times its level in the last eighth of life."""
    life = rng.uniform(500.0, 1200.0)
    at = np.arange(0.0, life, 2.0)
    rise = 5.0 * np.expm1(20.0 * np.maximum(at / life - 0.875, 0.0)) / np.expm1(2.5)
    level = rng.uniform(0.8, 1.3) * (1.0 + rise * fails) * (1.0 + 0.06 * np.sin(at / 4.0))
    value = level * (1.0 + 0.03 * rng.standard_normal(len(at)))
    return Indicator.of("rms", "g", Limit(20.0), at, value).with_(clock="h")


@pytest.mark.parametrize("seed", range(4))
def test_a_rise_is_not_told_by_healthy_ones_wherever_the_limit_lies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    broken = [rig(rng, fails=True) for _ in range(3)]
    ended = [one.with_(maintenance=(Maintenance(float(one.at[-1]), "failed"),)) for one in broken]
    fleet = learn([*ended, *(rig(rng, fails=False) for _ in range(9))])
    mine = rig(rng, fails=True)
    whole = float(mine.at[-1])
    for share in (0.94, 0.97):
        part = mine.until(share * whole)
        life = told(part, fleet)
        assert life.not_before < whole - float(part.at[-1])
        assert life.median < 0.3 * whole
    due = alarm_of("bearing", part, life, None, 0.1)
    assert due is not None and due.kind == "failure_due"
