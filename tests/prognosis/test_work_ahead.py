"""The work ahead: what a simulated cycle wears, on every kind of machine, and lives through it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.ahead.basis import Future
from evertwin.ahead.changes import Case
from evertwin.ahead.spec import SCENARIO
from evertwin.ahead.whatif import WhatIf
from evertwin.config import spec
from evertwin.errors import ConfigError, DataError, UsageError
from evertwin.models import Model
from evertwin.models.mujoco import MuJoCo
from evertwin.prognosis.formula import Formula
from evertwin.prognosis.laws import Life, Workload
from evertwin.prognosis.outlook.lives import ComponentLife
from evertwin.prognosis.outlook.workplan import wear, wears
from evertwin.setup.configured_model import model_of

GEARBOX = spec.IndicatorSpec(
    "gain", component="gearbox", parameter="gain", limit=0.7, direction="below"
)
ROD = """<mujoco><option timestep="0.005"/><worldbody><body>
<joint name="pivot" axis="0 1 0" damping="0.02"/>
<geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.5" mass="1"/></body></worldbody>
<actuator><motor name="motor" joint="pivot"/></actuator></mujoco>"""


def machine(kind: str, **options: Any) -> Model:
    return model_of(TwinSpec("m", spec.ModelSpec(kind, options)))


def rule(**more: Any) -> spec.IndicatorSpec:
    return spec.IndicatorSpec(**{"name": "worn", "limit": 1.0, **more})


def case(model: Model, u: np.ndarray, dt: float = 0.1) -> Case:
    p = model.parameters.values
    return Case(model, p, np.zeros(len(p)), Future(u, np.full(len(u), dt)))


def test_a_formula_works_on_columns() -> None:
    formula = Formula.parse("sqrt(a) / b ** 2 - axis[1].w")
    found = formula({"a": np.array([4.0, -1.0, 4.0]), "b": np.array([1.0, 1.0, 0.0]),
                     "axis[1].w": 1.0})  # fmt: skip
    assert found[0] == 1.0 and np.isnan(found[1:]).all()


@pytest.mark.parametrize(
    ("model", "told", "text"),
    [
        (machine("arm", urdf="ur5_like"), {"parameter": "Fc2", "exponent": 3.0},
         "abs(tau2) ** 3 * abs(qd2)"),
        (machine("arm", urdf="ur5_like"), {"formula": "0.5 * Fc1 + 2 * Fv1"},
         "abs(tau1) * abs(qd1)"),
        (machine("arm", urdf="ur5_like"), {"file": "x.csv"},
         " + ".join(f"abs(qd{k})" for k in range(1, 7))),
        (machine("arm", urdf="ur5_like"), {"file": "x.csv", "column": "backlash3"},
         "abs(tau3) * abs(qd3)"),
        (machine("drive"), {"parameter": "Fc"}, "abs(force) * abs(speed)"),
        (machine("robot1d"), {"parameter": "gain"}, "abs(x.rate)"),
        (machine("differential"), {"parameter": "gain"}, "sqrt(x.rate ** 2 + y.rate ** 2)"),
        (machine("thermal"), {"parameter": "heater_power"}, "1"),
        (MuJoCo.from_text(ROD), {"parameter": "joint.pivot.damping"},
         "abs(motor) * abs(pivot.vel)"),
    ],
)  # fmt: skip
def test_wear_follows_from_the_machine(model: Model, told: dict[str, Any], text: str) -> None:
    assert wears(rule(**told), model).text == text


def test_names_that_a_machine_has_not_are_told_with_the_nearest() -> None:
    arm = machine("arm", urdf="ur5_like")
    with pytest.raises(ConfigError, match=r"indicator worn: wear: .*'taux1', did you mean 'tau1'"):
        wears(rule(wear="abs(taux1)"), arm)
    with pytest.raises(ConfigError, match=r"did you mean 'qd1\.rate'"):
        wears(rule(wear="abs(qd1.rat)"), arm)
    with pytest.raises(ConfigError, match=r"indicator worn: wear: formula"):
        wears(rule(wear="max(tau1)"), arm)
    with pytest.raises(UsageError, match="wear or exponent"):
        rule(wear="abs(tau1)", exponent=3.0)


def test_wear_of_a_cycle_is_an_integral_over_its_simulation() -> None:
    cart = machine("robot1d")
    cart_case = case(cart, np.full((101, 1), -0.2))
    cart_case = replace(cart_case, p=np.array([0.5]))
    x = np.zeros(1)
    assert wear(Formula.parse("abs(v)"), cart_case, x) == pytest.approx(0.2 * 10.1)
    # the first row has no place before it: it goes as the second does
    assert wear(Formula.parse("abs(x.rate)"), cart_case, x) == pytest.approx(0.5 * 0.2 * 10.1)
    alone = replace(cart_case, future=Future(np.full((1, 1), -0.2), np.full(1, 0.1)))
    assert wear(Formula.parse("abs(x.rate)"), alone, x) == 0.0
    assert wear(Formula.parse("3 * gain"), cart_case, x) == pytest.approx(3 * 0.5 * 10.1)
    with pytest.raises(UsageError, match="expected 0 or more"):
        wear(Formula.parse("v"), cart_case, x)
    with pytest.raises(UsageError, match="no number in row 1 of"):
        wear(Formula.parse("1 / (v + 0.2)"), cart_case, x)


def test_states_and_turns_count() -> None:
    box = machine("thermal")
    heated = case(box, np.tile([0.5, 290.0], (50, 1)), 10.0)
    x = np.array([300.0, 291.0])
    temperature, now = [], x
    for row in heated.future.u:
        now, _ = box.simulate(now, row[None], np.array([10.0]), heated.p)
        temperature.append(now[0])
    found = wear(Formula.parse("heater * (state.heater - 273.15) ** 2"), heated, x)
    assert found == pytest.approx(5.0 * np.sum((np.array(temperature) - 273.15) ** 2))
    robot = machine("differential")
    turning = case(robot, np.tile([0.0, 1.0], (201, 1)))  # more than three turns
    assert wear(Formula.parse("abs(heading.rate)"), turning, np.zeros(3)) == pytest.approx(20.1)


# -- lives -----------------------------------------------------------------------------------------


def cart(**more: Any) -> Twin:
    rules = more.pop("indicator", (GEARBOX,))
    return Twin(TwinSpec("cart", spec.ModelSpec("robot1d"), indicator=rules, **more))


def recording(seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(200)
    v = 0.1 * np.sign(np.sin(0.4 * t)) + 0.05 * np.sin(1.3 * t)
    x = np.r_[0.0, np.cumsum(0.1 * v[:-1])]
    return {"t": t, "v": v, "x": x + rng.normal(0.0, 3e-4, 200)}


def history(path: Path, rows: int = 16, usage: float = 3.0) -> Path:
    """A gain that falls by 1 % a run, each run of so many cycles; 0.7 is passed at run 31."""
    rng = np.random.default_rng(3)
    lines = [f"{k + 1},{1.0 - 0.01 * k + rng.normal(0.0, 2e-3):.5f},{usage * k:g}"
             for k in range(rows)]  # fmt: skip
    path.write_text("run,gain,cycles\n" + "\n".join(lines) + "\n")
    return path


def gearbox(twin: Twin, table: Path) -> ComponentLife:
    return twin.life(table, recording()).components["gearbox"]


def known(one: ComponentLife) -> Life:
    assert isinstance(one.life, Life)
    return one.life


def test_phases_of_a_plan_pace_life(tmp_path: Path) -> None:
    table = history(tmp_path / "h.csv")
    before = known(gearbox(cart(), table))
    plan = (
        spec.WorkSpec("rush", cycles=2.0, until=4.0),
        spec.WorkSpec("more", cycles=1.0, begin=2.0, until=4.0),
        spec.WorkSpec("later", cycles=0.5, begin=10.0),
    )
    found = gearbox(cart(work=plan), table)
    assert [(p["begin"], p["until"], p["rate"]) for p in found.phases] == [
        (0.0, 2.0, 2.0), (2.0, 4.0, 3.0), (4.0, 10.0, 0.0), (10.0, None, 0.5)
    ]  # fmt: skip
    # 10 runs' wear is done by 4, none until 10, then half a run's wear a run
    work = before.remaining
    expected = np.where(work <= 4.0, work / 2.0, np.where(work <= 10.0, 2 + (work - 4) / 3.0,
                        10.0 + (work - 10.0) / 0.5))  # fmt: skip
    assert known(found).remaining == pytest.approx(expected)
    assert found.rate == pytest.approx(before.median / known(found).median)
    assert "from 4 to 10: rest; from 10 on: 0.5 times as fast" in str(
        cart(work=plan).life(table, recording())
    )


def test_after_the_end_of_the_plan_it_goes_on_as_before(tmp_path: Path) -> None:
    table = history(tmp_path / "h.csv")
    before = known(gearbox(cart(), table))
    holiday = gearbox(cart(work=(spec.WorkSpec("rest", 0.0, until=5.0),)), table)
    assert known(holiday).remaining == pytest.approx(before.remaining + 5.0)
    stop = gearbox(cart(work=(spec.WorkSpec("rest", 0.0),)), table)
    assert known(stop).median == np.inf and stop.rate == 0.0
    content = cart(work=(spec.WorkSpec("rest", 0.0, until=5.0),)).life(table, recording()).to_dict()
    entry: Any = content["components"]
    assert entry["gearbox"]["phases"][1] == {"begin": 5.0, "until": None, "rate": 1.0}
    assert entry["gearbox"]["wear"] == "abs(x.rate)"
    with pytest.raises(UsageError, match=r"work w: expected until after begin \(5\), got 5"):
        spec.WorkSpec("w", 1.0, begin=5.0, until=5.0)


def test_usage_counts_the_cycles_of_the_past(tmp_path: Path) -> None:
    """Three cycles a run so far: six ahead are twice the wear, not six times."""
    table = history(tmp_path / "h.csv")
    counted = replace(GEARBOX, usage="cycles")
    before = known(gearbox(cart(indicator=(counted,)), table))
    assert before.median == pytest.approx(15.0, abs=1.5)
    six = (spec.WorkSpec("six", 6.0),)
    found = gearbox(cart(indicator=(counted,), work=six), table)
    assert found.rate == pytest.approx(2.0)
    assert known(found).median == pytest.approx(before.median / 2.0)
    told = gearbox(cart(indicator=(counted,), work=six, prognosis=spec.PrognosisSpec(past=6.0)),
                   table)  # fmt: skip
    assert told.rate == pytest.approx(1.0)


def test_on_a_clock_of_time_the_past_must_be_told(tmp_path: Path) -> None:
    rows = "".join(f"{k},{1.0 - 0.01 * k}\n" for k in range(16))
    (tmp_path / "h.csv").write_text("d,gain\n" + rows)
    work = (spec.WorkSpec("weld", 40.0),)
    with pytest.raises(ConfigError, match=r"\[prognosis\] past: expected how many cycles"):
        gearbox(cart(work=work, prognosis=spec.PrognosisSpec("d")), tmp_path / "h.csv")
    rule = spec.PrognosisSpec("d", past=20.0)
    assert gearbox(cart(work=work, prognosis=rule), tmp_path / "h.csv").rate == pytest.approx(2.0)


def test_a_plan_that_a_machine_cannot_have_names_its_work(tmp_path: Path) -> None:
    table = history(tmp_path / "h.csv")
    with pytest.raises(UsageError, match=r"work 'weld': load: .* carries no payload"):
        gearbox(cart(work=(spec.WorkSpec("weld", 1.0, load=2.0),)), table)
    with pytest.raises(DataError, match=r"work 'new': .*absent\.csv"):
        gearbox(cart(work=(spec.WorkSpec("new", 1.0, path="absent.csv"),)), table)
    still = {"t": 0.1 * np.arange(50), "v": np.zeros(50), "x": np.linspace(0.0, 1e-3, 50)}
    with pytest.raises(UsageError, match="wears nothing by 'abs\\(v\\)'"):
        rules = (replace(GEARBOX, wear="abs(v)"),)
        cart(indicator=rules, work=(spec.WorkSpec("w", 1.0),)).life(table, still)


def test_a_machine_told_no_motion_follows_a_path(tmp_path: Path) -> None:
    """An incubator's heater: a speed cannot be meant, a path and a formula tell its wear."""
    rows = "".join(f"{k},{1.0 - 0.01 * k}\n" for k in range(1, 17))
    (tmp_path / "h.csv").write_text("run,power\n" + rows)
    heater = spec.IndicatorSpec("power", limit=0.7, direction="below", wear="heater ** 2",
                                file=str(tmp_path / "h.csv"))  # fmt: skip
    t = 30.0 * np.arange(60)
    on = (np.arange(60) % 10 < 5).astype(float)
    table = {"t": t, "heater": on, "room": np.full(60, 293.0), "box": np.linspace(293, 300, 60)}
    (tmp_path / "full.csv").write_text(
        "t,heater,room\n" + "".join(f"{k * 30},1,293\n" for k in range(60))
    )

    def rate(**work: Any) -> float:
        told = (spec.WorkSpec("warm", 1.0, **work),)
        box = TwinSpec("box", spec.ModelSpec("thermal"), indicator=(heater,), work=told)
        return Twin(box).life(data=table).components["power"].rate

    with pytest.raises(UsageError, match="work 'warm': speed: the input heater"):
        rate(speed=1.5)
    # it was on half of the time
    ahead = rate(path=str(tmp_path / "full.csv"))
    assert ahead == pytest.approx(2.0, rel=0.05)


def test_speed_and_load_of_an_arm_follow_its_torques(tmp_path: Path) -> None:
    """Inertia alone: torques go with speed², so wear of a cycle goes with speed^(2e)."""
    free = {f"F{c}{j}": spec.ParameterSpec(value=0.0) for c in "cv" for j in range(1, 7)}
    rows = "".join(f"{k},{1.0 + 0.01 * k}\n" for k in range(16))
    (tmp_path / "h.csv").write_text("run,Fc1\n" + rows)
    t = 0.05 * np.arange(120)
    w = np.arange(1, 7) * 0.3
    u = np.concatenate([np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w)),
                        -(w**2) * np.sin(np.outer(t, w))], axis=1)  # fmt: skip

    def told(exponent: float, **work: Any) -> tuple[ComponentLife, Twin, np.ndarray]:
        joint = spec.IndicatorSpec("Fc1", parameter="Fc1", limit=1.3, exponent=exponent)
        options = {"urdf": "ur5_like", "law": "sign", "gravity": (0.0, 0.0, 0.0)}
        kind = spec.ModelSpec("arm", options, parameters=free)
        works = (spec.WorkSpec("w", 1.0, **work),)
        arm = Twin(TwinSpec("arm", kind, indicator=(joint,), work=works))
        _, tau = arm.model.simulate(np.zeros(0), u, np.full(len(t), 0.05), arm.champion.p)
        names = (*arm.model.inputs.names, *arm.model.outputs.names)
        noise = np.random.default_rng(1).normal(0.0, 1e-3, tau.shape)
        table = {"t": t} | dict(zip(names, np.concatenate([u, tau + noise], axis=1).T, strict=True))
        return arm.life(tmp_path / "h.csv", table).components["Fc1"], arm, tau

    for exponent in (1.0, 3.0):
        assert told(exponent, speed=1.5)[0].rate == pytest.approx(1.5 ** (2 * exponent), rel=1e-6)
    one, arm, tau = told(1.0, load=3.0)
    loaded = model_of(TwinSpec("a", spec.ModelSpec("arm", {
        "urdf": "ur5_like", "law": "sign", "gravity": (0.0, 0.0, 0.0), "payload": True},
        parameters={**free, "payload.m": spec.ParameterSpec(value=3.0)})))  # fmt: skip
    _, heavy = loaded.simulate(np.zeros(0), u, np.full(len(t), 0.05), loaded.parameters.values)
    works = [np.sum(np.abs(y[1:, 0] * u[1:, 6])) for y in (tau, heavy)]
    assert one.rate == pytest.approx(works[1] / works[0], rel=1e-6) and one.rate > 1.05
    assert arm.champion.number == 0


def whatif(twin: Twin, text: str, table: Path) -> WhatIf:
    told = SCENARIO.parse(f'schema = 1\nname = "s"\n{text}', "s.toml")
    return twin.whatif(told, recording(), table)


def test_a_scenario_acts_on_each_piece_of_the_plan(tmp_path: Path) -> None:
    table = history(tmp_path / "h.csv")
    by_power = replace(GEARBOX, wear="abs(v) ** 3")  # a cycle s times as fast wears s² as much
    plan = (spec.WorkSpec("slow", 1.0, speed=0.5, until=8.0), spec.WorkSpec("fast", 1.0, 8.0))
    base = gearbox(cart(indicator=(by_power,)), table)
    twin = cart(indicator=(by_power,), work=plan)
    assert gearbox(twin, table).phases[0]["rate"] == pytest.approx(0.25)
    found: Any = whatif(twin, "[speed]\nfactor = 2.0", table).lives["gearbox"]
    ahead = known(base).through(Workload.phases((0.0, 8.0), (1.0, 4.0)), "run")
    assert found["with_scenario"]["median"] == pytest.approx(ahead.median)
    plain: Any = whatif(cart(indicator=(by_power,)), "[speed]\nfactor = 2.0", table).lives[
        "gearbox"
    ]
    assert plain["rate"] == pytest.approx(4.0)
    assert plain["with_scenario"]["median"] == pytest.approx(known(base).median / 4.0)


def test_a_scenario_is_told_without_lives_that_cannot_be(tmp_path: Path) -> None:
    table = history(tmp_path / "h.csv")
    found = whatif(cart(indicator=(replace(GEARBOX, wear="0 * v"),)), "horizon = 5", table)
    assert not found.lives and any("wears nothing by '0 * v'" in note for note in found.notes)


def test_values_of_a_work_are_those_of_its_scenario(tmp_path: Path) -> None:
    table = history(tmp_path / "h.csv")
    change = SCENARIO.parse(
        'schema = 1\nname = "s"\n[parameters]\ngain = { factor = 0.5 }', "s.toml"
    ).parameters
    found = gearbox(cart(work=(spec.WorkSpec("w", 3.0, parameters=change),)), table)
    assert found.rate == pytest.approx(1.5)
