"""Lives under a plan of other work: `python -m proofs.work_plan [PATHS]`.

A machine wears by its true friction work, a gamma process: in every run the worn value moves by κ·W
on the mean, 80 % of it more or less in a run of the past. W is ∫ |friction · speed| dt of the true
machine, as worn as it is by then; κ is such that the limit would be passed after 60 to 100 runs of
the past's work. At 50 and 70 % of that its life is asked. Then the work changes as the plan says: a
rush (more cycles, faster), a rest, and other work for good. Two machines:

* an arm's joint 2: Coulomb friction grows by half; the other work carries 1 to 5 kg. The true
  friction has a Coulomb, a viscous and a load part, tuned at each run from torques with noise of
  2 Nm. The formula is the twin's friction work.
* a cart: its gain falls by a twentieth, and speeds are all that it is told; the other work is
  another path. Its true friction is Coulomb and viscous. The formula knows their ratio.

Each run is a recording that `Twin.fit` tunes, on `twins/arm.toml` and `twins/robot1d.toml`. Both
are told by `Twin.life` from a history file, the newest recording and `[[work]]`: by the default for
the machine (|τ|·|q̇|, the way) and by a formula. "As before" leaves the plan out; the
dummy knows only the mean life under the past's work. "Unchanged" is the same answer where the work
of the past does go on: what the laws alone do here.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from evertwin import Twin
from evertwin.config import spec
from evertwin.machines.arm.inertia import NAMES, point
from evertwin.prognosis.laws import Life
from planted.twins import opened
from proofs._verdict import chance, ended, holds

CUTS = (0.5, 0.7)
SPREAD = 0.8
"""Standard deviation of the wear of a run of the past, over its mean."""
LONGEST = 2000


class Work(NamedTuple):
    """A phase of the plan: what the twin is told, and its true friction work by the level."""

    told: dict[str, Any]
    cycles: float
    length: float
    """How long [runs]."""
    work: Callable[[float], float]
    """True friction work of a cycle at a level of wear."""


@dataclass(frozen=True)
class Machine:
    """One kind of machine, with what is true of it and what is measured."""

    indicator: dict[str, Any]
    formula: str
    new: float
    limit: float
    work: Callable[[float], float]
    """True friction work of a cycle of the past."""
    plan: Callable[[np.random.Generator, Path], list[Work]]
    recording: Callable[[float, np.random.Generator], dict[str, np.ndarray]]
    """One run at a level of wear."""
    file: str
    """Twin file."""
    sections: dict[str, Any]
    """What differs from it."""


# -- an arm's joint --------------------------------------------------------------------------------

STEP = 0.02
NOISE = 2.0
"""Of a torque [Nm]."""
OPTIONS = {"urdf": "ur5_like", "law": "sign+load"}
TRUE = {"Fc2": 8.0, "Fv2": 5.0, "Fl2": 0.15, "offset2": 0.0}
"""Friction of joint 2 when new."""


def motion(speed: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A cycle of the arm's work, (n, 18) and (n,)."""
    t = STEP * np.arange(500)
    w = np.array([0.5, 0.8, 1.1, 1.3, 1.5, 1.7])
    shape = (np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w)), -(w**2) * np.sin(np.outer(t, w)))
    u = np.concatenate([part * speed**k for k, part in enumerate(shape)], axis=1)
    return u, np.full(len(t), STEP / speed)


def settings(**options: Any) -> dict[str, Any]:
    """`twins/arm.toml` with another law, of which joint 2's friction is tuned."""
    return {
        "model": {"options": {**OPTIONS, **options}, "parameters": {}},
        "moving": None, "source": (), "tuning": {"editable": tuple(TRUE)},
    }  # fmt: skip


def torques(speed: float, mass: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Torque of joint 2 without friction, and that of each part of its friction a unit, (n,)."""
    model = opened("arm", **settings(payload=True)).model
    load = dict(
        zip((f"payload.{n}" for n in NAMES), point(mass, np.zeros(3)).tolist(), strict=True)
    )
    u, dt = motion(speed)

    def joint(values: dict[str, float]) -> np.ndarray:
        p = model.parameters.with_values({**load, **values}).values
        tau: np.ndarray = model.simulate(np.zeros(0), u, dt, p)[1][:, 1]
        return tau

    bare = joint({})
    parts = {name: joint({name: 1.0}) - bare for name in TRUE}
    return bare, parts | {"Fl2": np.abs(bare) * parts["Fc2"]}  # of the payload too, unlike the twin


def friction_work(speed: float, mass: float) -> Callable[[float], float]:
    """True work of joint 2's friction in a cycle, by its Coulomb friction."""
    u, dt = motion(speed)
    _, parts = torques(speed, mass)
    done = {name: float(np.sum(part * u[:, 7] * dt)) for name, part in parts.items()}
    rest = sum(TRUE[name] * done[name] for name in ("Fv2", "Fl2"))
    return lambda friction: friction * done["Fc2"] + rest


def arm() -> Machine:
    """The arm's joint 2."""
    bare, parts = torques(1.0, 0.0)
    truth = opened("arm", **settings()).model
    u, dt = motion()

    def seen(friction: float, rng: np.random.Generator) -> np.ndarray:
        worn = {**TRUE, "Fc2": friction}
        return sum((worn[n] * parts[n] for n in parts), bare) + rng.normal(0.0, NOISE, len(bare))

    def recording(friction: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
        _, tau = truth.simulate(np.zeros(0), u, dt, truth.parameters.values)
        tau = tau + rng.normal(0.0, NOISE, tau.shape)
        tau[:, 1] = seen(friction, rng)
        names = (*truth.inputs.names, *truth.outputs.names)
        columns = np.concatenate([u, tau], axis=1).T
        return {"t": np.cumsum(dt)} | dict(zip(names, columns, strict=True))

    def plan(rng: np.random.Generator, _: Path) -> list[Work]:
        speed, mass = rng.uniform(1.1, 1.6), rng.uniform(1.0, 5.0)
        return [
            Work({"speed": speed}, rng.uniform(1.0, 1.5), rng.integers(3, 10),
                 friction_work(speed, 0.0)),
            Work({}, 0.0, rng.integers(3, 10), friction_work(1.0, 0.0)),
            Work({"load": mass}, rng.uniform(0.6, 2.0), np.inf, friction_work(1.0, mass)),
        ]  # fmt: skip

    return Machine(
        {"parameter": "Fc2"}, "(Fc2 + Fv2 * abs(qd2) + Fl2 * abs(tau2)) * abs(qd2)", TRUE["Fc2"],
        1.5 * TRUE["Fc2"], friction_work(1.0, 0.0), plan, recording, "arm", settings(),
    )  # fmt: skip


# -- a cart ----------------------------------------------------------------------------------------

VISCOUS = 2.5
"""True viscous over Coulomb friction [s/m]."""
RATE = 0.1


def told(way: float = 1.0, turns: float = 0.4) -> np.ndarray:
    """The speed that the cart is told in a cycle [m/s]."""
    t = RATE * np.arange(200)
    return way * (0.1 * np.sign(np.sin(turns * t)) + 0.05 * np.sin(1.3 * t))


def cart_work(v: np.ndarray, dt: float) -> Callable[[float], float]:
    """True work of the cart's friction in a cycle, by its gain."""
    way, square = float(np.sum(np.abs(v)) * dt), float(np.sum(v**2) * dt)
    return lambda gain: gain * way + VISCOUS * gain**2 * square


def cart() -> Machine:
    """The cart."""
    v = told()
    way = np.cumsum(v) * RATE

    def recording(gain: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
        t = RATE * np.arange(1, len(v) + 1)
        x = gain * way + rng.normal(0.0, 0.005, len(v))
        return {"t": t, "v": np.r_[v[1:], v[-1:]], "x": x}  # a command holds from its stamp on

    def plan(rng: np.random.Generator, folder: Path) -> list[Work]:
        speed, other = rng.uniform(1.1, 1.8), told(rng.uniform(0.5, 1.5), rng.uniform(0.3, 0.9))
        rows = "".join(f"{RATE * k:.1f},{x:.6f}\n" for k, x in enumerate(other))
        (folder / "other.csv").write_text("t,v [m/s]\n" + rows)  # SI: the twin file records cm/s
        return [
            Work({"speed": speed}, rng.uniform(1.0, 1.5), rng.integers(3, 10),
                 cart_work(speed * v, RATE / speed)),
            Work({}, 0.0, rng.integers(3, 10), cart_work(v, RATE)),
            Work({"path": "other.csv"}, rng.uniform(0.6, 2.0), np.inf, cart_work(other, RATE)),
        ]  # fmt: skip

    return Machine(
        {"parameter": "gain", "direction": "below"},
        f"(1 + {VISCOUS} * abs(x.rate)) * abs(x.rate)", 1.0, 0.95, cart_work(v, RATE), plan,
        recording, "robot1d", {"prediction": {"horizon": np.inf}, "correction": {"channels": ()}},
    )  # fmt: skip


# -- wear and answers ------------------------------------------------------------------------------


def scale(one: Machine, life: float) -> float:
    """κ: wear per friction work, such that ``life`` runs of the past's work reach the limit."""
    levels = np.linspace(one.new, one.limit, 1001)
    pace = 1.0 / np.array([one.work(float(x)) for x in levels])
    return abs(float(np.trapezoid(pace, levels))) / life


def grows(one: Machine, kappa: float, level: float, work: float, rng: np.random.Generator) -> float:
    """Growth of the worn value by some friction work."""
    usual = one.work(level)
    sign = 1.0 if one.limit > one.new else -1.0
    return sign * kappa * usual * SPREAD**2 * rng.gamma(work / usual * SPREAD**-2)


def passes(one: Machine, kappa: float, start: float, plan: list[Work], rng: np.random.Generator
           ) -> float:  # fmt: skip
    """When the limit is passed from ``start`` on under a plan [runs]."""
    sign, level, run = np.sign(one.limit - one.new), start, 0
    ends = np.cumsum([phase.length for phase in plan])
    while run < LONGEST:
        phase = plan[int(np.searchsorted(ends, run, side="right"))]
        grown = grows(one, kappa, level, phase.cycles * phase.work(level), rng)
        if sign * (level + grown - one.limit) >= 0.0:
            return run + (one.limit - level) / grown
        level, run = level + grown, run + 1
    return np.inf


class Answer(NamedTuple):
    """What was said, and what was true."""

    left: float
    same: float
    """True life if the past's work went on."""
    age: float
    lives: dict[str, Life | None]
    """By the way it was told."""


def answers(one: Machine, twin: Twin, seed: int, folder: Path) -> list[Answer]:
    """One machine from new on, asked at each cut."""
    rng = np.random.default_rng([20, seed])
    life = float(rng.uniform(60.0, 100.0))
    kappa, plan = scale(one, life), one.plan(rng, folder)
    found, level, values, rows = [], one.new, dict[str, float](), [",".join(("run", "value"))]
    for run in range(1, int(max(CUTS) * life) + 1):
        fit = twin.fit(one.recording(level, rng)).fit
        values = {name: fit[name] for name in fit.names}
        rows.append(f"{run},{values[one.indicator['parameter']]:.6g}")
        if run in [int(cut * life) for cut in CUTS]:
            (folder / "history.csv").write_text("\n".join(rows) + "\n")
            left, same = (
                passes(one, kappa, level, ahead, np.random.default_rng([21, seed, run]))
                for ahead in (plan, [Work({}, 1.0, np.inf, one.work)])
            )
            found.append(Answer(left, same, run, said(one, folder, plan, values, level)))
        level += grows(one, kappa, level, one.work(level), rng)
    return found


def said(
    one: Machine, folder: Path, plan: list[Work], values: dict[str, float], level: float
) -> dict[str, Life | None]:
    """The lives that the twin tells of the newest run, by default, by the formula, as before."""
    begins = np.cumsum([0.0, *(phase.length for phase in plan)])
    works = tuple(
        spec.WorkSpec(f"phase {k + 1}", phase.cycles, float(begins[k]),
                      None if np.isinf(phase.length) else float(begins[k + 1]), **phase.told)
        for k, phase in enumerate(plan)
    )  # fmt: skip
    now = {name: spec.ParameterSpec(value=value) for name, value in values.items()}
    model = {**one.sections.get("model", {}), "parameters": now}
    table = one.recording(level, np.random.default_rng(len(values)))
    found: dict[str, Life | None] = {}
    for name, wear in (("default", None), ("formula", one.formula)):
        rule = spec.IndicatorSpec(name="value", limit=one.limit, wear=wear, **one.indicator)
        ahead = {"indicator": (rule,), "work": works, "folder": str(folder), "model": model}
        with opened(one.file, **(one.sections | ahead)) as twin:
            told = twin.life(folder / "history.csv", table).components["value"]
        found[name] = told.life if isinstance(told.life, Life) else None
        found["as before"] = told.before if isinstance(told.before, Life) else None
    return found


def show(name: str, known: list[Answer], mean: float) -> dict[str, bool]:
    """Prints the counts of one machine; does the plan cost no coverage, and is it worth it?"""
    off, shares = dict[str, float](), dict[str, list[float]]()
    for how in ("formula", "default", "as before", "unchanged"):
        told = [(x, x.lives["as before" if how == "unchanged" else how]) for x in known]
        pairs = [(x.same if how == "unchanged" else x.left, life) for x, life in told if life]
        ends = [[life.interval80 for _, life in pairs], [life.interval95 for _, life in pairs]]
        inside = [
            sum(low <= left <= high for (left, _), (low, high) in zip(pairs, both, strict=True))
            for both in ends
        ]
        shares[how] = [count / len(pairs) for count in inside]
        off[how] = float(np.median([abs(life.median - left) for left, life in pairs]))
        print(
            f"{name:5} {how:10} answered {len(pairs)} of {len(known)}, true inside 80 % in "
            f"{inside[0]} ({shares[how][0]:.0%}), inside 95 % in {inside[1]} "
            f"({shares[how][1]:.0%}); median |error| {off[how]:.1f} runs"
        )
    dummy = float(np.median([abs(max(mean - x.age, 0.0) - x.left) for x in known]))
    print(f"{name:5} {'dummy':10} median |error| {dummy:.1f} runs")
    lost = np.array(shares["unchanged"]) - np.array(shares["formula"])
    demands = {
        f"{name}: a plan costs 5 points of coverage at most": bool(np.all(lost <= 0.05)),
        f"{name}: a plan is worth it": off["formula"] < min(off["as before"], dummy),
    }
    for level, share in zip((0.80, 0.95), shares["formula"], strict=True):
        error = chance(level, len(known) // len(CUTS))  # answers of one machine go together
        demands[f"{name}: intervals of {level:.0%}"] = holds(level, share, error)
    return demands


def main() -> int:
    """Prints the counts; exit code 1 if intervals do not hold, or a plan gains nothing."""
    paths = int(sys.argv[1]) if len(sys.argv) > 1 else 120
    demands: dict[str, bool] = {}
    with tempfile.TemporaryDirectory() as name:
        for word, one in (("arm", arm()), ("cart", cart())):
            with opened(one.file, **one.sections) as twin:
                known = [x for seed in range(paths) for x in answers(one, twin, seed, Path(name))]
            mean = float(np.mean(np.linspace(60.0, 100.0, 101)))
            demands |= show(word, known, mean)
    return ended(demands)


if __name__ == "__main__":
    sys.exit(main())
