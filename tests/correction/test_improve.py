"""Forward selection: planted terms are found, and nothing where there is nothing."""

from __future__ import annotations

import numpy as np
import pytest

from evertwin.correction.candidates import propose
from evertwin.correction.describe import describe
from evertwin.correction.evidence import gather
from evertwin.correction.numbers.fitting import fit_candidate
from evertwin.correction.search.improve import Selection, improve
from evertwin.correction.stack import Stack, stack_of
from evertwin.errors import DataError, UsageError
from evertwin.fold import Block, make_block, take
from evertwin.machines.mobile import Differential, Odometer, Robot1D
from evertwin.models import FunctionModel, Model, Parameters
from evertwin.models.corrected.corrected import Corrected, build
from evertwin.models.form import Form, Term
from evertwin.models.functions.translated import translated
from evertwin.models.terms.rows import Rows, propose_levels, quiet_level
from evertwin.signals import Layout
from planted.draws import first_of

DT = 0.1


def commands(seed: int, n: int, hold: int = 8) -> np.ndarray:
    """Random forward speeds up to 0.2 m/s and turn rates up to 0.6 rad/s, held."""
    rng = np.random.default_rng(seed)
    v, w = rng.uniform(-0.2, 0.2, n // hold), rng.uniform(-0.6, 0.6, n // hold)
    return np.repeat(np.stack([v, w], axis=1), hold, axis=0)


def drive(terms: tuple[Term, ...], values: dict[str, float], seed: int = 0, n: int = 2400) -> Block:
    """A recording of a differential base that has the terms; position to 1 mm, heading 2 mrad."""
    real = Corrected(Differential(), terms)
    p = real.parameters.with_values(values).values
    u = commands(seed, n)
    y = real.simulate(real.initial(p), u, np.full(n, DT), p)[1]
    y = y + np.random.default_rng(seed + 1).normal(size=y.shape) * (0.001, 0.001, 0.002)
    return make_block(t=np.arange(n) * round(DT * 1e9), u=u, y=y)


def value(proposal_names: tuple[str, ...], p: np.ndarray, name: str) -> float:
    return float(p[proposal_names.index(name)])


LAG = Term("lag", "*", levels=(8.0,))
SLIP = Term("coupling", "v", "w", "magnitude")


@pytest.mark.slow
def test_lag_and_coupling_are_found_with_their_numbers() -> None:
    planted = {"lag.delay": 0.12, "lag.tau": 0.25, "coupling.v.w.slip": 0.065}
    rows = drive((SLIP, LAG), planted)
    found = improve(Differential(), Form(), (rows,), 2.0, Selection(kinds=("lag", "coupling")))
    kinds = sorted((t.kind, t.channel, t.source) for t in found.form.terms)
    assert kinds == [("coupling", "v", "w"), ("lag", "*", "")]
    assert value(found.names, found.p, "coupling.v.w.slip") == pytest.approx(0.065, abs=0.004)
    delay, tau = (value(found.names, found.p, f"lag.{n}") for n in ("delay", "tau"))
    assert delay + tau == pytest.approx(0.37, abs=0.02)
    assert found.after < 0.3 * found.before
    assert len(found.describes) == 2 and found.evidence()["steps"]


@first_of("seed", range(3))
def test_a_base_that_turns_less_the_faster_it_drives_keeps_its_own_gain(seed: int) -> None:
    """Turns at w·(0.65 − 1.3·|v|), where the model has a number for the turn rate's gain."""
    share = Term("coupling", "w", "v", "share")
    planted = {"coupling.w.v.gain": 0.65, "coupling.w.v.slip": 2.0}
    settings = Selection(kinds=("coupling",), channels=("w",), numbers=("turn_gain",))
    found = improve(Differential(), Form(), (drive((share,), planted, seed),), 2.0, settings)
    assert [term.variant for term in found.form.terms] == ["share"]
    assert value(found.names, found.p, "turn_gain") == pytest.approx(0.65, abs=0.01)
    assert value(found.names, found.p, "coupling.w.v.slip") == pytest.approx(2.0, abs=0.1)
    assert found.taken == ("coupling.w.v.gain",)


def test_a_term_whose_gain_is_all_there_is_to_it_is_none() -> None:
    settings = Selection(kinds=("coupling",), channels=("w",), numbers=("turn_gain",))
    only = Term("coupling", "w", "v", "grip")
    planted = {"coupling.w.v.gain": 0.65}
    found = improve(Differential(), Form(), (drive((only,), planted),), 2.0, settings)
    assert not found.found and found.form == Form()


@first_of("seed", range(4))
def test_a_perfect_model_is_left_alone(seed: int) -> None:
    rows = drive((), {}, seed, 1200)
    kinds = ("lag", "coupling", "law", "table")
    found = improve(Differential(), Form(), (rows,), 2.0, Selection(kinds=kinds))
    assert not found.found and found.form == Form()
    assert np.array_equal(found.p, Differential().parameters.values)


@pytest.mark.parametrize("variant", ["dead zone", "clamp"])
def test_start_threshold_and_saturation_are_recovered(variant: str) -> None:
    rng = np.random.default_rng(3)
    command = np.repeat(rng.permutation(np.arange(1, 21)), 5) / 100
    law = Corrected(Robot1D(), (Term("law", "v", variant=variant),))
    p = np.array([1.0, 0.06, 0.97, 0.002, 0.16])
    x = law.simulate(np.zeros(1), command[:, None], np.ones(100), p)[1]
    x = x + 0.002 * rng.normal(size=x.shape)
    rows = make_block(t=np.arange(100) * 10**9, u=command[:, None], y=x)
    found = improve(Robot1D(), Form(), (rows,), 1.0, Selection(kinds=("law",)))
    assert [t.variant for t in found.form.terms] == [variant]
    assert value(found.names, found.p, "law.v.threshold") == pytest.approx(0.06, abs=0.01)
    assert value(found.names, found.p, "law.v.cap") == pytest.approx(0.16, abs=0.005)
    assert variant in found.describes[0]


def test_a_cap_that_no_command_reaches_is_none() -> None:
    rng = np.random.default_rng(3)
    command = np.repeat(rng.permutation(np.arange(1, 21)), 5) / 100
    moved = np.where(command > 0.06, 0.7 * command, 0.0)
    x = moved.cumsum() + 0.001 * rng.normal(size=100)
    rows = make_block(t=np.arange(100) * 10**9, u=command[:, None], y=x[:, None])
    found = improve(Robot1D(), Form(), (rows,), 1.0, Selection(kinds=("law",)))
    assert found.describes[0].startswith("v: start threshold 0.06 m/s (dead zone), gain 0.")
    assert "saturation" not in found.describes[0]
    assert value(found.names, found.p, "law.v.cap") > 1.0


def test_a_law_takes_the_place_of_a_table() -> None:
    rng = np.random.default_rng(4)
    command = np.repeat(np.arange(1, 21), 5) / 100
    moved = np.minimum(0.97 * command, 0.16)
    x = moved.cumsum() + 0.001 * rng.normal(size=100)
    rows = make_block(t=np.arange(100) * 10**9, u=command[:, None], y=x[:, None])
    table = Form((Term("table", "v", levels=tuple((np.arange(10) + 1) / 50)),))
    found = improve(Robot1D(), table, (rows,), 1.0, Selection(kinds=("law",)))
    assert [t.kind for t in found.form.terms] == ["law"]
    assert found.gains[0].replaced == table.terms


def test_a_table_is_learned_with_its_levels_from_the_data() -> None:
    rng = np.random.default_rng(5)
    levels = np.array([0.0, 0.05, 0.1, 0.2])
    effect = np.array([0.0, 0.02, 0.1, 0.12])
    pick = rng.integers(0, 4, 200)
    x = effect[pick].cumsum() + 0.001 * rng.normal(size=200)
    rows = make_block(t=np.arange(200) * 10**9, u=levels[pick][:, None], y=x[:, None])
    found = improve(Robot1D(), Form(), (rows,), 1.0, Selection(kinds=("table",)))
    assert found.form.terms[0].levels == tuple(levels)
    assert found.p[1:] == pytest.approx(effect, abs=0.002)


def test_a_surface_is_learned_and_held_out_rows_agree() -> None:
    """A speed limit that falls with the turn rate, without the form that says so."""
    grip = Term("coupling", "v", "w", "grip")
    planted = {
        "coupling.v.w.gain": 1.0,
        "coupling.v.w.inverse_cap": 4.0,
        "coupling.v.w.inverse_grip": 20.0,
    }
    train, test = drive((grip,), planted, 0, 4000), drive((grip,), planted, 7, 1600)
    settings = Selection(kinds=("surface",), channels=("v",))
    found = improve(Differential(), Form(), (train,), 2.0, settings)
    assert [t.kind for t in found.form.terms] == ["surface"]
    model = build(Differential(), found.form)
    unseen = gather(model, (test,), 2.0, found.scale, found.p)
    left = np.abs(unseen.residual(model, found.p)[:, :2]).mean()
    naive = np.abs(unseen.residual(Differential(), np.ones(2))[:, :2]).mean()
    assert left < 0.2 * naive


def test_an_extra_state_is_found() -> None:
    """A tank (the robot's kernel is an integrator) that exchanges with one that is not seen."""
    tank = Robot1D()
    real = Corrected(tank, (Term("state", "x"),))
    p = np.array([1.0, 0.05, 0.01, -2.0])
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-0.2, 0.2, 60), 10)[:, None]
    y = real.simulate(real.initial(p), u, np.ones(600), p)[1]
    y = y + 0.01 * rng.normal(size=y.shape)
    rows = make_block(t=np.arange(600) * 10**9, u=u, y=y)
    settings = Selection(kinds=("state",), channels=("x",), least=8)
    found = improve(tank, Form(), (rows,), 60.0, settings)
    assert [t.kind for t in found.form.terms] == ["state"]
    assert value(found.names, found.p, "state.x.loss") == pytest.approx(0.05, rel=0.1)
    assert value(found.names, found.p, "state.x.start") == pytest.approx(-2.0, abs=0.3)
    assert "hidden state" in found.describes[0]


def test_every_proposed_candidate_can_be_fitted() -> None:
    rows = drive((LAG,), {"lag.delay": 0.1, "lag.tau": 0.2}, n=800)
    stack, evidence = stack_of(Differential(), Form()), gather(Differential(), (rows,), 2.0)
    kinds = ("lag", "coupling", "law", "table", "surface", "state")
    candidates = propose(Rows(Differential(), (rows,), ("v", "w", "heading"), 2.0), kinds)
    assert {c.term.kind for c in candidates} == set(kinds)
    for candidate in candidates:
        scored = fit_candidate(stack, candidate, evidence)
        assert np.isfinite(scored.deviations).all()
        assert (
            scored.mean < 1.2 * evidence.deviations(evidence.residual(stack.model, stack.p)).mean()
        )


def test_several_windows_count_like_tasks() -> None:
    rows = [drive((LAG,), {"lag.delay": 0.1, "lag.tau": 0.3}, seed, 400) for seed in range(4)]
    found = improve(Differential(), Form(), rows, 2.0, Selection(kinds=("lag",)))
    assert [t.kind for t in found.form.terms] == ["lag"]


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6, 0.9])
def test_a_dead_time_up_to_the_horizon_is_no_lag(share: float) -> None:
    rows = drive((LAG,), {"lag.delay": share * 2.0, "lag.tau": 0.0}, n=1200)
    found = improve(Differential(), Form(), (rows,), 2.0, Selection(kinds=("lag",)))
    assert value(found.names, found.p, "lag.delay") == pytest.approx(share * 2.0, abs=0.02)
    assert value(found.names, found.p, "lag.tau") < 0.02


def test_misuse() -> None:
    short = make_block(t=np.arange(3) * 10**9, u=np.ones((3, 1)), y=np.ones((3, 1)))
    with pytest.raises(DataError, match="at least 4 segments"):
        improve(Robot1D(), Form(), (short,), 1.0)
    n = np.arange(20)
    more = make_block(t=n * 10**9, u=0.1 * n[:, None], y=0.1 * n.cumsum()[:, None])
    with pytest.raises(DataError, match="at least 30 segments"):
        improve(Robot1D(), Form(), (more,), 1.0)
    static = FunctionModel(lambda x, u, dt, p: ([], [u[0]]), Layout.of(v="1"), Layout.of(y="1"))
    with pytest.raises(UsageError, match="static map"):
        improve(static, Form(), (short,), 1.0)
    with pytest.raises(UsageError, match="share"):
        Selection(gain=0.0)


def test_odometer_misses_nothing_when_heading_was_not_measured() -> None:
    rows = drive((SLIP,), {"coupling.v.w.slip": 0.1})
    travel = np.full((len(rows.t), 2), np.nan)
    truth = Corrected(Odometer(), (SLIP,))
    p = truth.parameters.with_values({"coupling.v.w.slip": 0.1}).values
    travel[:, 0] = truth.simulate(np.zeros(2), rows.u, rows.dt, p)[1][:, 0]
    seen = make_block(t=rows.t, u=rows.u, y=travel)
    found = improve(Odometer(), Form(), (seen,), 2.0, Selection(kinds=("coupling",)))
    assert value(found.names, found.p, "coupling.v.w.slip") == pytest.approx(0.1, abs=0.01)


def test_levels_and_quantum() -> None:
    u = np.linspace(-0.07, 0.2, 500)
    assert propose_levels(u, quantum=0.05) == pytest.approx(np.arange(-2, 5) * 0.05)
    with pytest.raises(DataError, match="changes"):
        propose_levels(np.ones(5))
    assert quiet_level(np.array([0.0, 0.01, 0.02])) == 0.005
    assert quiet_level(np.linspace(0, 1, 500)) == 0.0


def test_every_kind_is_said_in_words() -> None:
    stack = Stack(Differential(), (1.0, 1.0))
    grid = (0.0, 1.0)
    for term, values, said in [
        (Term("coupling", "v", "w", "proportional"), (-0.1,), "v: rises by 0.1·w"),
        (Term("coupling", "v", "w", "grip"), (1.0, 0.0, 0.5), "limited to 2/|w| m/s"),
        (Term("coupling", "v", "w", "grip"), (1.0, 0.5, 0.5), "1/(0.5 + 0.5·|w|) m/s"),
        (Term("coupling", "v", "w", "share"), (1.0, 0.5), "v: falls by a share of 0.5·|w|"),
        (Term("coupling", "v", "w", "share"), (0.9, -0.5), "gain 0.9, rises by a share of 0.5·|w|"),
        (Term("table", "v", levels=grid), (0.0, 0.7), "table of 2 levels"),
        (Term("surface", "v", "w", levels=grid, levels2=grid), (0.0,) * 4, "surface over v and w"),
        (Term("lag", "*", variant="delay"), (0.1,), "all inputs: delay of 0.1 s"),
        (Term("law", "v"), (1.0, 0.1, 0.5), "offset 0.1 m/s"),
    ]:
        assert said in describe(stack.plus(term, values))[0]


def test_what_is_said_is_what_goes_live() -> None:
    rows = drive((LAG,), {"lag.delay": 0.3, "lag.tau": 0.2}, n=1200)
    found = improve(Differential(), Form(), (rows,), 2.0, Selection(kinds=("lag",)))
    delay, tau = (value(found.names, found.p, f"lag.{n}") for n in ("delay", "tau"))
    assert f"delay of {delay:.3g} s and a first-order lag of {tau:.3g} s" in found.describes[0]
    every = stack_of(Differential(), found.form, found.p)
    fold = fit_candidate(
        stack_of(Differential(), Form()),
        next(iter(propose(Rows(Differential(), (rows,), (), 2.0), ("lag",)))),
        gather(Differential(), (rows,), 2.0, found.scale),
    )
    # the numbers of all rows, not those of the last fold that was predicted without its own
    assert every.p == pytest.approx(fold.stack.p, abs=1e-3)


def chamber(seed: int) -> tuple[Model, Block]:
    """A heated chamber as configured, its numbers all wrong, and two recordings of one with a wall
    that nobody measures, which begins anywhere."""
    rng = np.random.default_rng(seed)

    def step(x, u, dt, p):  # type: ignore[no-untyped-def]
        gain, rate, low = p
        ahead = x[0] + dt * rate * (gain * u[0] + low - x[0])
        return [ahead], [ahead]

    air = Layout.of(x="K")
    numbers = Parameters.of(gain=(1.0, "K"), rate=(0.03, "1/s"), low=(10.0, "K"))
    model = translated(FunctionModel(step, Layout.of(u="1"), air, air, numbers))
    real = Corrected(model, (Term("state", "x"),))
    n, parts = 1000, []
    for _ in range(2):
        start = rng.uniform(-6.0, 6.0)
        values = {"gain": 2.0, "rate": 0.05, "low": 15.0, "state.x.loss": 0.04}
        values |= {"state.x.gain": 0.008, "state.x.start": start}
        p = real.parameters.with_values(values).values
        u = np.repeat(rng.choice([0.0, 4.0, 8.0, 12.0], n // 50), 50)[:, None]
        x = real.initial(p)
        x[0] = 20.0
        y = real.simulate(x, u, np.ones(n), p)[1] + 0.05 * rng.standard_normal((n, 1))
        parts.append((u, y))
    u, y = (np.concatenate(column) for column in zip(*parts, strict=True))
    task = np.repeat([0, 1], n)
    return model, make_block(t=np.arange(2 * n) * 10**9, u=u, y=y, task=task)


@first_of("seed", range(10))
def test_a_term_is_found_beside_numbers_that_are_all_wrong(seed: int) -> None:
    model, rows = chamber(seed)
    windows = tuple(take(rows, a, a + 1000) for a in (0, 1000))
    asked = Selection(
        ("lag", "law", "state"), ("u", "x"), numbers=model.parameters.names, beside=True
    )
    found = improve(model, Form(), windows, 20.0, asked)
    assert [term.kind for term in found.form.terms] == ["state"]
    values = dict(zip(found.names, found.p.tolist(), strict=True))
    for name, true in {"gain": 2.0, "rate": 0.05, "low": 15.0, "state.x.loss": 0.04}.items():
        assert values[name] == pytest.approx(true, rel=0.1)
