"""A real skid-steered base: `python -m proofs.drive_warthog` (needs EVERTWIN_DATA).

Clearpath Warthog (Baril et al., arXiv:2309.10718), windows of 2 s at random wheel commands. Even
calibration steps train, odd ones test. Score: mean absolute error in m of the signed way
d = Σ|Δxy|·sign(icp_vx) in steady windows, of the longitudinal way Σ(Δx cos ψ + Δy sin ψ) in
transitory ones. Naive: 0.30 m · mean of both wheel commands · 1.95 s.

One search with one set of settings gives every line; a line says which kinds of term it may use.
The default is all of them. The last column is the gate's verdict on the odd steps, naive model
against this one, and the windows it took.
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evertwin.correction.evidence import gather
from evertwin.correction.improve import Proposal, Selection, improve
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Odometer
from evertwin.models.corrected import build
from evertwin.models.form import Form
from evertwin.models.terms.registry import KINDS
from evertwin.trial.gate import Trial

ROWS, STEP, HORIZON = 40, 50_000_000, 1.95
RADIUS = 0.30
TABLE, LAW, AIM, LAG = 0.345, 0.21, 0.16, 0.85


class Windows(NamedTuple):
    """Inputs (360, 40), ways (360, 39), which windows are steady, and which train."""

    u: np.ndarray
    path: np.ndarray
    along: np.ndarray
    steady: np.ndarray
    train: np.ndarray


def columns(path: Path) -> dict[str, np.ndarray]:
    """A file by column."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def load(folder: Path) -> Windows:
    """All windows."""
    summary = columns(folder / "warthog_window_summary.csv")
    c = {k: v.reshape(-1, ROWS) for k, v in columns(folder / "warthog_windows.csv").items()}
    dx, dy = np.diff(c["icp_x"], axis=1), np.diff(c["icp_y"], axis=1)
    yaw = np.unwrap(c["icp_yaw"], axis=1)
    middle = 0.5 * (yaw[:, 1:] + yaw[:, :-1])
    left, right = c["cmd_left"], c["cmd_right"]
    return Windows(
        0.5 * RADIUS * np.stack([left + right, right - left], axis=2),
        np.hypot(dx, dy) * np.sign(summary["icp_vx"])[:, None],
        dx * np.cos(middle) + dy * np.sin(middle), summary["steady_state_mask"] > 0,
        summary["calib_step"] % 2 == 0,
    )  # fmt: skip


def blocks(data: Windows, chosen: np.ndarray, steady: bool) -> list[Block]:
    """The chosen windows; a transitory one is led by the window before it: a lag has a past."""
    found = []
    for k in np.flatnonzero(chosen):
        led = [data.u[k - 1], data.u[k, 1:]] if k > 0 and not steady else [data.u[k]]
        u = np.concatenate(led)
        y = np.full((len(u), 2), np.nan)
        y[-ROWS:, 0] = np.r_[0.0, (data.path if steady else data.along)[k].cumsum()]
        found.append(make_block(t=np.arange(len(u)) * STEP, u=u, y=y))
    return found


def error(found: Proposal, windows: list[Block]) -> tuple[float, float]:
    """Mean absolute error of the way over a window, and its standard error."""
    model, p, missed = build(Odometer(), found.form), found.p, []
    for window in windows:
        y = model.simulate(model.initial(p), window.u, window.dt, p)[1][:, 0]
        missed.append(abs(y[-1] - y[-ROWS] - window.y[-1, 0]))
    return float(np.mean(missed)), float(np.std(missed) / np.sqrt(len(missed)))


def gate(found: Proposal, windows: list[Block]) -> str:
    """The verdict of the trial, and after how many windows."""
    base, trial = Odometer(), Trial(horizon=HORIZON)
    pairs = []
    for model, p in ((base, np.ones(2)), (build(base, found.form), found.p)):
        seen = gather(model, windows, HORIZON, found.scale, p)
        pairs.append(seen.deviations(seen.residual(model, p)) ** 2)
    state = trial.init()
    for n, pair in enumerate(np.stack(pairs, axis=1)):
        state, verdict = trial.step(state, pair[None])
        if verdict:
            return f"{verdict} after {n + 1}"
    return f"undecided after {len(pairs[0])}"


def naive() -> Proposal:
    """The model as it is."""
    return Proposal(Form(), (), np.ones(2), 1.0, 1.0, np.ones(2))


def show(name: str, found: Proposal, test: list[Block], limit: float) -> bool:
    """One line; is the limit held?"""
    score, spread = error(found, test)
    verdict = gate(found, test) if found.form.terms else ""
    sys.stdout.write(f"{name:34s} {score:6.3f} ± {spread:.3f}  limit {limit:5.3f}  {verdict}\n")
    for said in found.describes:
        sys.stdout.write(f"    {said}\n")
    return score <= limit


def main() -> int:
    """Exit code 1 if a limit is missed."""
    data = load(Path(os.environ["EVERTWIN_DATA"]) / "drive_warthog")
    held = []
    sys.stdout.write("steady windows, m\n")
    parts = [blocks(data, data.steady & (data.train == even), True) for even in (True, False)]
    train, test = parts
    show("naive", naive(), test, np.inf)
    lines = (
        ("table", ("table",), TABLE), ("law", ("law",), np.inf), ("default: all kinds", KINDS, LAW),
        ("surface alone (aim)", ("surface",), AIM),
    )  # fmt: skip
    best = naive()
    for name, kinds, limit in lines:
        found = improve(Odometer(), Form(), train, HORIZON, Selection(kinds=kinds, channels=("v",)))
        held.append(show(name, found, test, limit))
        best = found if kinds == KINDS else best
    sys.stdout.write("transitory windows, m\n")
    train, test = (
        blocks(data, ~data.steady & (data.train == even), False) for even in (True, False)
    )
    show("naive", naive(), test, np.inf)
    settings = Selection(channels=("v",))
    alone = improve(Odometer(), Form(), train, HORIZON, Selection(kinds=("lag",), channels=("v",)))
    held.append(show("lag alone", alone, test, LAG))
    found = improve(Odometer(), best.form, train, HORIZON, settings, best.p)
    held.append(show("all kinds, on the steady terms", found, test, LAG))
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
