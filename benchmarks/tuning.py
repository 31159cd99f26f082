"""Tuning against its peers, in one run: `python -m benchmarks tuning`.

The twin file `twins/arm.toml` on the rows that its world records (`python -m evertwin.worlds.arm`):
one cycle of 690 rows with six Coulomb torques, and 100 cycles with Coulomb and viscous friction.
`solve(problem)` is what `evertwin fit` calls, from rows in memory to the record that it prints:
values, verdicts, intervals, residual statistics, on a problem that has computed nothing before. Its
peers get the same rows as arrays and give values alone:

* one pass: Pinocchio's inverse dynamics once for every sample, then NumPy's least squares axis by
  axis; constants, tanh included, as far as they can be computed for all samples at once;
* the same with Pinocchio's batch call (one thread);
* SciPy's `least_squares`, weighted, with covariance; the rigid part once, or in every evaluation;
* ProgPy's `estimate_params` (BFGS), where ProgPy is installed.

Times are processor time of one thread, all methods in turn, medians of the repeats; ratios are to
`solve`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

os.environ["OMP_NUM_THREADS"] = "1"  # a thread that waits for another one counts as work

import numpy as np
from scipy import optimize

from evertwin import Twin
from evertwin.tuning import Fit, Problem, solve

TWIN = Path(__file__).parent.parent / "twins" / "arm.toml"
NOISE = np.array([0.5, 0.8, 0.5, 0.08, 0.08, 0.06])
"""Of the world's torque sensors [Nm]."""
WIDTH = 0.02
AXES = range(1, 7)
Work = Callable[[], Any]


def say(text: str) -> None:
    """One line on stdout, at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def medians(works: Mapping[str, Work], repeats: int) -> dict[str, float]:
    """Median processor time of each [s], all in turn; the first round warms up."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repeats + 1):
        for name, work in works.items():
            start = time.process_time()
            work()
            times[name].append(time.process_time() - start)
    return {name: float(np.median(found[1:] or found)) for name, found in times.items()}


class Pinocchio:
    """The arm of the twin file in Pinocchio, with the numbers that are not tuned."""

    def __init__(self, problem: Problem) -> None:
        import pinocchio as pin

        with as_file(files("evertwin.machines") / "data" / "ur5_like.urdf") as urdf:
            self.model = pin.buildModelFromUrdf(str(urdf))
        self.pin, self.data = pin, self.model.createData()
        self.pool = pin.ModelPool(self.model, 1)
        u = np.concatenate([window.u for window in problem.windows])
        self.q, self.v, self.a = (np.ascontiguousarray(part) for part in np.split(u, 3, axis=1))
        self.tau = np.concatenate([window.y for window in problem.windows])
        self.both = len(problem.names) > 6
        known = {item.name: item.value for item in problem.parameters}
        self.rotor = np.array([known[f"Ia{j}"] for j in AXES])
        self.viscous = np.array([known[f"Fv{j}"] for j in AXES])
        self.start = np.array([known[name] for name in problem.names])

    def rigid(self) -> np.ndarray:
        """Torques of the rigid bodies, sample by sample."""
        rnea, out = self.pin.rnea, np.empty_like(self.tau)
        for i, (q, v, a) in enumerate(zip(self.q, self.v, self.a, strict=True)):
            out[i] = rnea(self.model, self.data, q, v, a)
        return out

    def batch(self) -> np.ndarray:
        """The same by its batch call."""
        out = np.empty(self.tau.shape[::-1], order="F")
        self.pin.rneaInParallel(1, self.pool, self.q.T, self.v.T, self.a.T, out)
        return out.T

    def one_pass(self, rigid: Callable[[], np.ndarray]) -> np.ndarray:
        """NumPy's least squares, axis by axis."""
        left, switch = self.tau - rigid() - self.rotor * self.a, np.tanh(self.v / WIDTH)
        if not self.both:
            left -= self.viscous * self.v
        found = []
        for j in range(6):
            columns = [switch[:, j], self.v[:, j]] if self.both else [switch[:, j]]
            found.append(np.linalg.lstsq(np.column_stack(columns), left[:, j], rcond=None)[0])
        return np.array(found).T.ravel()

    def torques(self, p: np.ndarray, rigid: np.ndarray, switch: np.ndarray) -> np.ndarray:
        """All of the model."""
        viscous = p[6:] if self.both else self.viscous
        return rigid + self.rotor * self.a + p[:6] * switch + viscous * self.v

    def scipy(self, once: bool) -> np.ndarray:
        """SciPy's search and its covariance, rigid bodies ``once`` or in every evaluation."""
        rigid, switch = self.rigid(), np.tanh(self.v / WIDTH)

        def residuals(p: np.ndarray) -> np.ndarray:
            seen = rigid if once else self.rigid()
            return ((self.tau - self.torques(p, seen, switch)) / NOISE).ravel()

        found = optimize.least_squares(residuals, self.start)
        np.linalg.inv(found.jac.T @ found.jac)
        return np.asarray(found.x)

    def progpy(self) -> np.ndarray:
        """ProgPy's `estimate_params` with BFGS."""
        made, names = progpy_model(self), [f"Fc{j}" for j in AXES]
        times = [0.1 * i for i in range(len(self.q))]
        zero = made.InputContainer(dict.fromkeys(made.inputs, 0.0))
        rows = [dict(zip(made.outputs, row, strict=True)) for row in self.tau.tolist()]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            made.estimate_params(
                times=times, inputs=[zero] * len(times), method="BFGS", dt=0.1, keys=names,
                outputs=[made.OutputContainer(row) for row in rows],
            )  # fmt: skip
        return np.array([made.parameters[name] for name in names])


def progpy_model(case: Pinocchio) -> Any:
    """The arm as a ProgPy model: the state is the sample's number, outputs are torques."""
    from progpy import PrognosticsModel

    class ArmModel(PrognosticsModel):  # type: ignore[misc]
        """Rigid bodies and friction."""

        inputs: ClassVar = ["u"]
        states: ClassVar = ["k"]
        outputs: ClassVar = [f"tau{j}" for j in AXES]
        events: ClassVar = ["end"]
        default_parameters: ClassVar = {"x0": {"k": 0.0}} | {
            f"Fc{j}": case.start[j - 1] for j in AXES
        }

        def next_state(self, x: Any, u: Any, dt: float) -> Any:
            x["k"] = x["k"] + dt / 0.1
            return x

        def output(self, x: Any) -> Any:
            i = min(max(round(float(np.asarray(x["k"]).item())), 0), len(case.q) - 1)
            rigid = case.pin.rnea(case.model, case.data, case.q[i], case.v[i], case.a[i])
            friction = np.array([self.parameters[f"Fc{j}"] for j in AXES])
            tau = rigid + case.rotor * case.a[i] + friction * np.tanh(case.v[i] / WIDTH)
            tau = tau + case.viscous * case.v[i]
            return self.OutputContainer(dict(zip(self.outputs, tau, strict=True)))

        def event_state(self, x: Any) -> Any:
            return {"end": 1.0}

        def threshold_met(self, x: Any) -> Any:
            return {"end": False}

    return ArmModel()


@dataclass(frozen=True)
class Asked:
    """What `solve` has to reach: a share of one pass, a multiple of SciPy."""

    share: float = 0.5
    times: float = 6.0


def compare(problem: Problem, asked: Asked, repeats: int, slow: bool) -> list[str]:
    """Prints all methods on one problem; the demands that are missed."""
    peer = Pinocchio(problem)
    works: dict[str, Work] = {
        "solve, with verdicts and intervals": lambda: solve(replace(problem)),
        "one Pinocchio pass + NumPy": lambda: peer.one_pass(peer.rigid),
        "the same, Pinocchio's batch call": lambda: peer.one_pass(peer.batch),
        "SciPy, rigid part once": lambda: peer.scipy(once=True),
    }
    found = medians(works, repeats)
    if slow:
        works["SciPy, rigid part every time"] = lambda: peer.scipy(once=False)
    if slow and find_spec("progpy") is not None:
        works["ProgPy, BFGS"] = peer.progpy
    for name in list(works)[len(found) :]:
        found |= medians({name: works[name]}, 1 if name.startswith("ProgPy") else 3)
    fit: Fit = solve(replace(problem))
    say(f"-- {len(peer.q)} x {len(problem.names)}: {', '.join(fit.names)}; "
        f"{fit.verdict.count('identifiable')} identifiable")  # fmt: skip
    first = found["solve, with verdicts and intervals"]
    for name, seconds in found.items():
        gap = "" if name.startswith("solve") else np.abs(works[name]() - fit.values).max()
        same = f"   values differ by {gap:.1e}" if gap else ""
        say(f"{name:<36}{1e3 * seconds:10.3f} ms {seconds / first:10.2f} x{same}")
    if slow and find_spec("progpy") is None:
        say("ProgPy is not installed: pip install 'evertwin[bench]'")
    size, missed = f"{len(peer.q)} x {len(problem.names)}", []
    share = first / found["one Pinocchio pass + NumPy"]
    times = found["SciPy, rigid part once"] / first
    say(f"asked: at most {asked.share:g} of one pass: {share:.2f}; "
        f"at least {asked.times:g} x SciPy with the rigid part once: {times:.1f}")  # fmt: skip
    if share > asked.share:
        missed.append(f"{size}: {share:.2f} of one pass, {asked.share:g} asked")
    if times < asked.times:
        missed.append(f"{size}: {times:.1f} x SciPy, {asked.times:g} asked")
    return missed


def recorded(folder: Path) -> Path:
    """One cycle of the welding arm, by its world."""
    with as_file(files("evertwin.machines") / "data" / "ur5_like.urdf") as urdf:
        world = [sys.executable, "-m", "evertwin.worlds.arm", "--urdf", str(urdf)]
        subprocess.run([*world, "--out", str(folder)], check=True)
    return next(folder.glob("*.csv"))


def long(record: Path, cycles: int) -> dict[str, np.ndarray]:
    """The cycle again and again, each time with noise of its own."""
    with record.open(encoding="utf-8") as file:
        names = [name.split()[0] for name in file.readline().split(",")]
    table, rng = np.loadtxt(record, delimiter=",", skiprows=1), np.random.default_rng(0)
    columns = {name: np.tile(one, cycles) for name, one in zip(names, table.T, strict=True)}
    for j in AXES:
        columns[f"tau{j}"] += NOISE[j - 1] * rng.standard_normal(len(columns["t"]))
    columns["t"] = 0.1 * np.arange(len(columns["t"]))
    return columns


def command(record: Path) -> list[str]:
    """Prints the time of the whole `fit` command on the cycle; the demands that are missed."""
    line = [str(Path(sys.executable).with_name("evertwin")), "fit", str(TWIN)]
    spent: list[float] = []
    for _ in range(4):  # the first fills caches
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [*line, "--train", str(record), "--json"], capture_output=True, text=True, check=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    seconds, tuning = float(np.median(spent[1:])), json.loads(done.stdout)["seconds"]
    say(f"-- evertwin fit twins/arm.toml --train CYCLE.csv --json: processor {seconds:.2f} s, "
        f"of which tuning {1e3 * tuning:.2f} ms; asked: 1.5 s")  # fmt: skip
    return [] if seconds <= 1.5 else [f"fit as a command: {seconds:.2f} s, 1.5 asked"]


def main() -> int:
    """Runs all sizes; 1 if a demand is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=25)
    repeats = parser.parse_args().repeats
    with tempfile.TemporaryDirectory() as folder:
        record = recorded(Path(folder))
        with Twin.open(TWIN) as twin:
            short, many = twin.problem([record]), twin.problem(long(record, 100))
        missed = compare(short, Asked(), 4 * repeats, slow=True)
        both = tuple(f"{kind}{j}" for kind in ("Fc", "Fv") for j in AXES)
        missed += compare(replace(short, editable=both), Asked(), 4 * repeats, slow=False)
        missed += compare(replace(many, editable=both), Asked(times=12.0), max(repeats // 3, 3),
                          slow=False)  # fmt: skip
        missed += command(record)
    for line in missed:
        say(f"MISSED {line}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
