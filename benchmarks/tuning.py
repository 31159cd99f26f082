"""Tuning against its peers, in one run: `python -m benchmarks.tuning [--repeats 7]`.

A 6-axis arm, tanh friction, start at half the truth. Every method goes from arrays q, q̇, q̈, τ to
parameters (ours and SciPy's also to their covariance), rigid-body part included:

* closed form, prepared plan (`ClosedForm.solve`), with our own compiled inverse dynamics, which is
  checked against Pinocchio first;
* cached closed form: the regressor is known already, the limit of any method;
* `solve`: the whole record with verdicts, intervals and residual statistics;
* SciPy `least_squares` with Pinocchio's rnea in a loop over samples, friction in the loop (as one
  writes it first) and outside (as one writes it second);
* ProgPy `estimate_params` (BFGS) on the same torques, where ProgPy is installed.

Times are medians of the processor time of one thread, so that other work on the machine weighs
less; ratios are to the closed form, end to end.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy import optimize

from evertwin.fold import make_block
from evertwin.machines.arm import Arm
from evertwin.machines.arm.lanes import batch
from evertwin.tuning import ClosedForm, Problem, solve

FC = np.array([12.0, 14.0, 10.0, 3.0, 3.0, 2.5])
BM = np.array([10.0, 10.0, 8.0, 2.0, 2.0, 2.0])
NOISE = np.array([0.5, 0.8, 0.5, 0.08, 0.08, 0.06])
WIDTH = 0.02


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def median(work: Callable[[], Any], repeats: int) -> float:
    """Median time of ``work`` [s] after one warm-up call."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return float(np.median(times))


def timed(work: Callable[[], Any], n: int, repeats: int) -> tuple[Any, float]:
    """(result, time): the median of repeats, or one run where that takes seconds."""
    start = time.process_time()
    result = work()
    once = time.process_time() - start
    return result, once if n >= 10_000 else median(work, repeats)


class Case:
    """One size: motion, torques and the arm."""

    def __init__(self, n: int, kinds: tuple[str, ...]) -> None:
        rng = np.random.default_rng(0)
        t = 0.1 * np.arange(n)[:, None]
        w, a = rng.uniform(0.2, 0.7, (2, 6)), rng.uniform(0.3, 0.9, (2, 6))
        self.q = sum(a[i] * np.sin(w[i] * t) for i in range(2))
        self.qd = sum(a[i] * w[i] * np.cos(w[i] * t) for i in range(2))
        self.qdd = sum(-a[i] * w[i] ** 2 * np.sin(w[i] * t) for i in range(2))
        bare = Arm.of("ur5_like", law="tanh", rotor=False)
        self.names = tuple(f"{kind}{k + 1}" for kind in kinds for k in range(6))
        self.truth = np.concatenate([{"Fc": FC, "Fv": BM}[kind] for kind in kinds])
        values = {f"Fc{k + 1}": FC[k] for k in range(6)} | {f"Fv{k + 1}": BM[k] for k in range(6)}
        full = bare.parameters.with_values(values)
        u = self.inputs()
        _, tau = bare.simulate(np.zeros(0), u, np.zeros(n), full.values)
        self.tau = tau + NOISE * rng.standard_normal(tau.shape)
        half = full.with_values(dict(zip(self.names, 0.5 * self.truth, strict=True)))
        self.arm = Arm(bare.chain, bare.laws, rotor=False, parameters=half)
        self.plan = ClosedForm(self.arm, self.names)
        self.dt = np.full(n, 0.1)

    def inputs(self) -> np.ndarray:
        return np.concatenate([self.q, self.qd, self.qdd], axis=1)

    def closed(self) -> Any:
        return self.plan.solve(self.inputs(), self.dt, self.tau)

    def cached(self) -> Callable[[], Any]:
        values = self.arm.parameters.values
        y0, phi = self.arm.regressor(np.zeros(0), self.inputs(), self.dt, values)
        return lambda: self.plan.solve_rows(self.tau, y0, phi)

    def record(self) -> Any:
        stamps = np.arange(len(self.q)) * 10**8
        block = make_block(t=stamps, u=self.inputs(), y=self.tau)
        return solve(Problem(self.arm, (block,), self.names))


def pinocchio() -> tuple[Any, Any, Any]:
    """The same arm in Pinocchio: module, model, data."""
    import pinocchio as pin

    with as_file(files("evertwin.machines") / "data" / "ur5_like.urdf") as urdf:
        model = pin.buildModelFromUrdf(str(urdf))
    return pin, model, model.createData()


def inside(case: Case, engine: tuple[Any, Any, Any], p: np.ndarray) -> np.ndarray:
    """Torques with everything in the loop over samples."""
    pin, model, data = engine
    viscous = p[6:] if len(p) > 6 else BM
    tau = np.empty_like(case.tau)
    for i in range(len(tau)):
        v = case.qd[i]
        rigid = pin.rnea(model, data, case.q[i], v, case.qdd[i])
        tau[i] = rigid + p[:6] * np.tanh(v / WIDTH) + viscous * v
    return tau


def outside(case: Case, engine: tuple[Any, Any, Any], p: np.ndarray) -> np.ndarray:
    """Torques with only the rigid bodies in the loop."""
    pin, model, data = engine
    rows = zip(case.q, case.qd, case.qdd, strict=True)
    rigid = np.array([pin.rnea(model, data, q, v, a) for q, v, a in rows])
    viscous = p[6:] if len(p) > 6 else BM
    return rigid + p[:6] * np.tanh(case.qd / WIDTH) + viscous * case.qd


def scipy_loop(case: Case, engine: tuple[Any, Any, Any], torques: Any) -> Any:
    """SciPy's least squares, residuals weighted by the noise, and the covariance."""

    def residuals(p: np.ndarray) -> np.ndarray:
        return ((case.tau - torques(case, engine, p)) / NOISE).ravel()

    found = optimize.least_squares(residuals, 0.5 * case.truth)
    return found.x, np.linalg.inv(found.jac.T @ found.jac)


def progpy_model(case: Case, engine: tuple[Any, Any, Any]) -> Any:
    """The arm as a ProgPy model: the state is the sample's number, outputs are torques."""
    from progpy import PrognosticsModel

    class ArmModel(PrognosticsModel):
        inputs: ClassVar = [f"{s}{k}" for s in ("q", "v", "a") for k in range(6)]
        states: ClassVar = ["k"]
        outputs: ClassVar = [f"tau{k}" for k in range(6)]
        events: ClassVar = ["end"]
        default_parameters: ClassVar = {"x0": {"k": 0.0}} | {
            f"Fc{k}": 0.5 * FC[k] for k in range(6)
        }

        def next_state(self, x: Any, u: Any, dt: float) -> Any:
            x["k"] = x["k"] + dt / 0.1
            return x

        def output(self, x: Any) -> Any:
            i = min(max(round(float(np.asarray(x["k"]).item())), 0), len(case.q) - 1)
            pin, model, data = engine
            rigid = pin.rnea(model, data, case.q[i], case.qd[i], case.qdd[i])
            fc = np.array([self.parameters[f"Fc{k}"] for k in range(6)])
            tau = rigid + fc * np.tanh(case.qd[i] / WIDTH) + BM * case.qd[i]
            return self.OutputContainer({f"tau{k}": tau[k] for k in range(6)})

        def event_state(self, x: Any) -> Any:
            return {"end": 1.0}

        def threshold_met(self, x: Any) -> Any:
            return {"end": False}

    return ArmModel()


def progpy_bfgs(case: Case, engine: tuple[Any, Any, Any]) -> Any:
    """ProgPy's estimate_params with BFGS on the same samples."""
    model = progpy_model(case, engine)
    times = [0.1 * i for i in range(len(case.q))]
    zero = dict.fromkeys(model.inputs, 0.0)
    inputs = [model.InputContainer(zero) for _ in times]
    outputs = [model.OutputContainer({f"tau{k}": row[k] for k in range(6)}) for row in case.tau]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.estimate_params(
            times=times, inputs=inputs, outputs=outputs, keys=[f"Fc{k}" for k in range(6)],
            method="BFGS", dt=0.1,
        )  # fmt: skip
    return np.array([model.parameters[f"Fc{k}"] for k in range(6)])


def size(n: int, kinds: tuple[str, ...], repeats: int) -> None:
    """Prints all methods at one size."""
    case, engine = Case(n, kinds), pinocchio()
    pin, model, data = engine
    mine = batch(case.arm.chain.geometry, case.arm.chain.inertia, case.inputs())
    theirs = np.array([pin.rnea(model, data, *row) for row in
                       zip(case.q[:500], case.qd[:500], case.qdd[:500], strict=True)])  # fmt: skip
    worst = np.abs(mine[:500] - theirs).max()
    say(f"-- {len(case.names)} parameters, {n} samples; inverse dynamics differ from Pinocchio by "
        f"{worst:.1e} Nm")  # fmt: skip
    ours = median(case.closed, max(repeats, 5))
    limit = median(case.cached(), max(repeats, 5))
    whole = median(case.record, max(3, repeats // 2))
    say(f"closed form, end to end        {1e3 * ours:10.3f} ms")
    say(f"closed form, cached regressor  {1e3 * limit:10.3f} ms   {ours / limit:6.1f} x the limit")
    say(f"whole record (solve)           {1e3 * whole:10.3f} ms")
    for label, torques in (("friction in the loop", inside), ("rigid part only", outside)):
        values, loop = timed(lambda f=torques: scipy_loop(case, engine, f), n, repeats)
        gap = np.abs(case.closed().values - values[0]).max()
        say(f"SciPy loop, {label:<19}{1e3 * loop:10.3f} ms   {loop / ours:6.0f} x slower; "
            f"same optimum to {gap:.1e}")  # fmt: skip
    if n >= 10_000 or len(kinds) > 1:
        return
    if find_spec("progpy") is None:
        say("ProgPy is not installed: pip install progpy")
        return
    found, theirs_s = timed(lambda: progpy_bfgs(case, engine), 10_000, 1)
    gap = np.abs(found - case.closed().values).max()
    say(f"ProgPy estimate_params, BFGS   {1e3 * theirs_s:10.1f} ms   "
        f"{theirs_s / ours:6.0f} x slower; same estimate to {gap:.1e} Nm")  # fmt: skip


def command() -> None:
    """Prints the time of the whole `fit` command on one recorded cycle of the welding arm."""
    with tempfile.TemporaryDirectory() as folder:
        with as_file(files("evertwin.machines") / "data" / "ur5_like.urdf") as urdf:
            world = [sys.executable, "-m", "evertwin.worlds.arm", "--urdf", str(urdf)]
            subprocess.run([*world, "--out", folder], check=True)
        record = next(Path(folder).glob("*.csv"))
        twin = Path(__file__).parent.parent / "twins" / "arm.toml"
        line = [str(Path(sys.executable).with_name("evertwin")), "fit", str(twin)]
        spent, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        done = subprocess.run(
            [*line, "--train", str(record), "--json"], capture_output=True, text=True, check=False
        )
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        say(f"-- evertwin fit ended with {done.returncode}: {done.stderr.splitlines()[-1]}")
        return
    processor = after.ru_utime + after.ru_stime - spent.ru_utime - spent.ru_stime
    tuning = json.loads(done.stdout)["seconds"]
    say(f"-- evertwin fit, 690 samples from CSV, start of Python to JSON: {wall:.2f} s, processor "
        f"{processor:.2f} s, of which tuning {tuning:.3f} s")  # fmt: skip


def main() -> int:
    """Runs all sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    repeats = parser.parse_args().repeats
    size(690, ("Fc",), repeats)
    size(690, ("Fc", "Fv"), repeats)
    size(69_000, ("Fc", "Fv"), repeats)
    command()
    return 0


if __name__ == "__main__":
    sys.exit(main())
