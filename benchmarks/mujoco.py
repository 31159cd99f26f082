"""Tuning a MuJoCo model against its peers: `python -m benchmarks.mujoco [--repeats 3]`.

A five-axis arm under motor torques; damping and armature of every joint (ten parameters) are tuned
on recorded positions and speeds, from half the truth. Everybody gets the same arrays, the same
weighted residual, the same bounds and the same tolerance, and starts each second of data from the
same state:

* evertwin: `least_squares` on `evertwin.models.mujoco.MuJoCo`, all columns of a Jacobian at once,
  in threads and with one thread; and `solve`, with identifiability, intervals and statistics;
* SciPy `least_squares` with a loop over ``mj_step``, as one writes it first;
* SciPy `least_squares` with ``mujoco.rollout`` over the seconds in threads, as one writes it next;
* mujoco.sysid with its own optimiser, where its packages are installed.

Wall-clock and processor time, the best of the repeats: on a machine that others use, too, the first
depends on which processors are free, the second is the work. Two sizes.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco import rollout
from scipy import optimize

from evertwin.fold import make_block
from evertwin.models import Parameter, Parameters
from evertwin.models.mujoco import MuJoCo
from evertwin.tuning import Problem, solve
from evertwin.tuning.search.nonlinear import Settings, least_squares

STEP, JOINTS = 0.002, 5
DAMPING = np.array([1.2, 1.0, 0.7, 0.3, 0.2])
ARMATURE = np.array([0.4, 0.3, 0.25, 0.1, 0.05])
TRUTH = np.concatenate([DAMPING, ARMATURE])
NOISE = np.array([1e-4] * JOINTS + [1e-3] * JOINTS)
TOLERANCE = 1e-8
LENGTHS, AXES = (0.15, 0.4, 0.35, 0.1, 0.1), ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0")


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def model_text() -> str:
    """The arm; damping and armature as a data sheet would have them: half of what they are."""
    bodies, ends = "", ""
    for j, (length, axis) in enumerate(zip(LENGTHS, AXES, strict=True)):
        at = 0.0 if j == 0 else LENGTHS[j - 1]
        bodies += (
            f'<body name="link{j + 1}" pos="0 0 {at}"><joint name="joint{j + 1}" axis="{axis}" '
            f'damping="{0.5 * DAMPING[j]}" armature="{0.5 * ARMATURE[j]}"/>'
            f'<geom type="capsule" size=".04" fromto="0 0 0 0 0 {length}" mass="{3.0 / (j + 1)}"/>'
        )
        ends += "</body>"
    motors = "".join(f'<motor name="motor{j + 1}" joint="joint{j + 1}"/>' for j in range(JOINTS))
    seen = "".join(
        f'<joint{word} name="{word}{j + 1}" joint="joint{j + 1}"/>'
        for word in ("pos", "vel") for j in range(JOINTS)
    )  # fmt: skip
    return (
        f'<mujoco><option timestep="{STEP}" integrator="implicitfast"><flag contact="disable"/>'
        f"</option><worldbody>{bodies}{ends}</worldbody><actuator>{motors}</actuator>"
        f"<sensor>{seen}</sensor></mujoco>"
    )


class Case:
    """Recorded seconds: start states, torques, measured positions and speeds."""

    def __init__(self, seconds: int) -> None:
        rng = np.random.default_rng(0)
        self.n, self.seconds = round(1.0 / STEP), seconds
        t = STEP * np.arange(self.n)
        size = np.array([8.0, 12.0, 6.0, 1.5, 1.0])
        self.start = np.concatenate(
            [rng.uniform(-0.5, 0.5, (seconds, JOINTS)), np.zeros((seconds, JOINTS))], axis=1
        )
        self.u = np.empty((seconds, self.n, JOINTS))
        for s in range(seconds):
            w, phase = rng.uniform(3, 20, (2, JOINTS)), rng.uniform(0, 6, (2, JOINTS))
            waves = [np.sin(t[:, None] * w[k] + phase[k]) for k in range(2)]
            self.u[s] = size * (waves[0] + 0.5 * waves[1])
        self.text = model_text()
        self.measured = np.empty((seconds, self.n, 2 * JOINTS))
        clean = self.by_steps(TRUTH)
        self.measured = clean + NOISE * rng.standard_normal(clean.shape)

    def by_steps(self, p: np.ndarray) -> np.ndarray:
        """Positions and speeds by a loop over mj_step."""
        model = self.changed(p)
        data = mujoco.MjData(model)
        out = np.empty_like(self.measured)
        for s in range(self.seconds):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = self.start[s, :JOINTS], self.start[s, JOINTS:]
            for i in range(self.n):
                data.ctrl[:] = self.u[s, i]
                mujoco.mj_step(model, data)
                out[s, i, :JOINTS], out[s, i, JOINTS:] = data.qpos, data.qvel
        return out

    def by_rollout(self, p: np.ndarray) -> np.ndarray:
        """The same by mujoco.rollout, the seconds in threads."""
        model = self.changed(p)
        data = [mujoco.MjData(model) for _ in range(os.cpu_count() or 1)]
        before = np.concatenate([np.zeros((self.seconds, 1)), self.start], axis=1)
        states, _ = rollout.rollout(model, data, before, self.u, persistent_pool=True)
        return np.asarray(states[:, :, 1:])

    def changed(self, p: np.ndarray) -> Any:
        model = mujoco.MjModel.from_xml_string(self.text)
        model.dof_damping[:], model.dof_armature[:] = p[:JOINTS], p[JOINTS:]
        return model


class Ours:
    """The case as a tuning problem."""

    def __init__(self, case: Case, threads: int = 0) -> None:
        names = [f"joint.joint{j + 1}.{w}" for w in ("damping", "armature") for j in range(JOINTS)]
        states = [f"joint{j + 1}.{w}" for w in ("pos", "vel") for j in range(JOINTS)]
        model = MuJoCo.from_text(case.text, outputs=states, parameters=names, threads=threads)
        blocks = []
        for s in range(case.seconds):
            y = np.concatenate([case.start[s][None], case.measured[s]])
            u = np.concatenate([np.zeros((1, JOINTS)), case.u[s]])
            stamps = np.arange(case.n + 1) * round(1e9 * STEP)
            blocks.append(make_block(t=stamps, u=u, y=y))
        prior = Parameters(tuple(_bounded(item) for item in model.parameters))
        self.problem = Problem(model, tuple(blocks), tuple(names), scale=NOISE, prior=prior)
        order = self.problem.names
        self.order = [order.index(name) for name in names]

    def search(self) -> np.ndarray:
        found = least_squares(self.problem, Settings(tolerance=TOLERANCE))
        return np.asarray(found.values)[self.order]

    def whole(self) -> np.ndarray:
        found = solve(self.problem, settings=Settings(tolerance=TOLERANCE))
        return np.asarray(found.values)[self.order]


def _bounded(item: Parameter) -> Parameter:
    return replace(item, low=1e-3, high=10.0)


def scipy_search(case: Case, simulate: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """SciPy's least squares with its own differences."""

    def residual(p: np.ndarray) -> np.ndarray:
        return ((case.measured - simulate(p)) / NOISE).ravel()

    found = optimize.least_squares(
        residual, 0.5 * TRUTH, bounds=(1e-3, 10.0), xtol=TOLERANCE, ftol=TOLERANCE
    )
    return np.asarray(found.x)


def sysid_search(case: Case) -> np.ndarray:
    """mujoco.sysid: its parameters, its rollouts, its Gauss-Newton."""
    from mujoco import sysid

    spec = mujoco.MjSpec.from_string(case.text)
    model = spec.compile()
    params = sysid.ParameterDict()
    for k, (word, values) in enumerate((("damping", DAMPING), ("armature", ARMATURE))):
        for j in range(JOINTS):

            def write(s: Any, p: Any, joint: str = f"joint{j + 1}", word: str = word) -> None:
                value = float(p.value[0])
                setattr(s.joint(joint), word, [value, 0, 0] if word == "damping" else value)

            start = 0.5 * float(values[j])
            params.add(sysid.Parameter(f"p{k}{j}", start, 1e-3, 10.0, modifier=write))
    # It wants a control at the end of the last step too, and reads none after it.
    times = STEP * np.arange(case.n + 1)
    controls = [sysid.TimeSeries(times, np.concatenate([u, u[-1:]])) for u in case.u]
    sensors = [sysid.TimeSeries.from_names(times[1:], y, model) for y in case.measured]
    before = [
        sysid.create_initial_state(model, x[:JOINTS], x[JOINTS:], np.zeros(0)) for x in case.start
    ]
    group = sysid.ModelSequences(
        "arm", spec, [f"s{k}" for k in range(case.seconds)], before, controls, sensors
    )

    def residual(
        p: Any, predicted: Any, measured: Any, *_: Any, state: Any = None, **__: Any
    ) -> Any:
        return (measured.data - state[:, 1:]) / NOISE, measured, measured

    function = sysid.build_residual_fn(
        models_sequences=[group], modify_residual=residual, resample_true=False
    )
    found, _ = sysid.optimize(
        initial_params=params, residual_fn=function, optimizer="mujoco", verbose=False,
        max_iters=100, xtol=TOLERANCE, output=io.StringIO(),
    )  # fmt: skip
    return np.asarray(found.as_vector())


class Took(NamedTuple):
    """Seconds."""

    wall: float
    processor: float

    def against(self, ours: Took) -> str:
        """Both times, and both as multiples of ours."""
        return (
            f"{self.wall:8.3f} s {self.processor:8.3f} s   {self.wall / ours.wall:5.1f} x "
            f"{self.processor / ours.processor:5.1f} x"
        )


def timed(work: Callable[[], np.ndarray], repeats: int) -> tuple[np.ndarray, Took]:
    """(result, best times)."""
    walls, processors = [], []
    for _ in range(repeats):
        wall, processor = time.perf_counter(), time.process_time()
        result = work()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
    return result, Took(min(walls), min(processors))


def compare(seconds: int, repeats: int) -> bool:
    """Prints all methods on so many seconds of data; True if all found one optimum."""
    case = Case(seconds)
    threaded, single = Ours(case), Ours(case, threads=1)
    own = threaded.problem.predict(0.5 * TRUTH[np.argsort(threaded.order)])
    loop = case.by_steps(0.5 * TRUTH)
    gap = np.nanmax(np.abs(own.reshape(seconds, case.n + 1, -1)[:, 1:] - loop))
    say(f"-- {seconds} s of data, {seconds * case.n} steps, 10 parameters; roll-outs differ by "
        f"{gap:.1e}")  # fmt: skip
    steps = seconds * case.n
    half = 0.5 * TRUTH
    _, mine = timed(lambda: single.problem.predict(half[np.argsort(single.order)]), 5)
    _, theirs = timed(lambda: case.by_steps(half), 5)
    say(f"one roll-out, processor time: {1e6 * mine.processor / steps:.2f} us a step, a loop over "
        f"mj_step {1e6 * theirs.processor / steps:.2f} us")  # fmt: skip
    best, ours = timed(threaded.search, repeats)
    say(f"{'':<36}    wall  processor   as multiples of ours")
    say(f"{'evertwin, search':<36}{ours.against(ours)}   largest error "
        f"{np.abs(best / TRUTH - 1).max():.1e} of the truth")  # fmt: skip
    good = True
    others: list[tuple[str, Callable[[], np.ndarray], int]] = [
        ("evertwin, one thread", single.search, repeats),
        ("evertwin, with intervals (solve)", threaded.whole, repeats),
        ("SciPy, loop over mj_step", lambda: scipy_search(case, case.by_steps), repeats),
        ("SciPy, mujoco.rollout in threads", lambda: scipy_search(case, case.by_rollout), repeats),
    ]
    if find_spec("absl") is not None and find_spec("tabulate") is not None:
        others.append(("mujoco.sysid", lambda: sysid_search(case), repeats))
    else:
        say("mujoco.sysid is not installed: pip install 'mujoco[sysid]'")
    for label, work, times in others:
        found, took = timed(work, times)
        off = float(np.abs(found / best - 1).max())
        good &= off < 1e-3
        say(f"{label:<36}{took.against(ours)}   same optimum to {off:.1e}")
    return good


def main() -> int:
    """Runs both sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    repeats = parser.parse_args().repeats
    good = [compare(4, repeats), compare(20, max(1, repeats // 2))]
    say("one optimum everywhere" if all(good) else "NOT the same optimum")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
