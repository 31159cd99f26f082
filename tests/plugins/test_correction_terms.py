"""A kind of correction term of another package: one file, and everything knows it."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from evertwin.correction.describe import describe
from evertwin.correction.evidence import gather
from evertwin.correction.numbers.intervals import profiled
from evertwin.correction.search.improve import Selection, improve
from evertwin.correction.stack import stack_of
from evertwin.errors import ConfigError, LawBroken, UsageError
from evertwin.fold import Block, make_block
from evertwin.machines.mobile import Differential, Robot1D
from evertwin.models import check_model
from evertwin.models.checks.term import check_term
from evertwin.models.corrected.corrected import Corrected, build
from evertwin.models.form import Form, Term, Version
from evertwin.models.terms.registry import KINDS, kind
from evertwin.twin import Twin

pytestmark = pytest.mark.usefixtures("own_terms")
RATE, DT = 0.08, 0.1


def drive(seed: int = 0, n: int = 1600) -> Block:
    """A robot whose speed changes by 0.08 m/s a second at most."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-0.2, 0.2, n // 20), 20)
    speed, x, places = 0.0, 0.0, []
    for wanted in u:
        for _ in range(10):
            speed += float(np.clip(wanted - speed, -RATE * DT / 10, RATE * DT / 10))
            x += speed * DT / 10
        places.append(x)
    y = np.array(places) + rng.normal(0.0, 1e-3, n)
    return make_block(t=np.arange(n) * round(DT * 1e9), u=u[:, None], y=y[:, None])


@pytest.mark.parametrize("name", [*KINDS, "ramp"])
def test_every_kind_keeps_the_laws_of_the_contract(name: str) -> None:
    check_term(kind(name))


def test_the_search_finds_it_among_the_others() -> None:
    settings = Selection(kinds=("lag", "law", "ramp"))
    found = improve(Robot1D(), Form(), (drive(),), 4.0, settings)
    assert [term.kind for term in found.form.terms] == ["ramp"]
    rate = float(found.p[found.names.index("ramp.v.rate")])
    assert rate == pytest.approx(RATE, rel=0.03)
    assert found.describes == (f"v: changes by at most {rate:.3g} m/s a second",)
    assert found.after < 0.2 * found.before


def test_its_number_has_an_interval_which_the_sentence_says() -> None:
    model = Corrected(Robot1D(), (Term("ramp", "v"),))
    p = model.parameters.with_values({"ramp.v.rate": RATE}).values
    known = profiled(model, p, ("ramp.v.rate",), (), gather(Robot1D(), (drive(),), 4.0))
    low, high = known["ramp.v.rate"].interval95
    assert low < RATE < high and high - low < 0.02
    said = describe(stack_of(Robot1D(), Form(model.terms), p), {"ramp.v.rate": (low, high)})
    assert said == (f"v: changes by at most 0.08 ({low:.3g} to {high:.3g}) m/s a second",)


def test_it_stacks_with_the_others_and_comes_back_from_json() -> None:
    terms = (Term("law", "v"), Term("ramp", "v"), Term("ramp", "w"), Term("lag", "*"))
    model = build(Differential(), Form((*terms, Term("state", "x"))))
    assert "ramp.v.rate" in model.parameters.names and "ramp2.reached" in model.states.names
    check_model(model)
    version = Version(1, Form(terms), model.parameters.names, tuple(model.parameters.values))
    again = Version.from_json(json.loads(json.dumps(version.to_json())))
    assert again.hash == version.hash
    stack = stack_of(Differential(), Form(())).plus(Term("state", "x"), (0.1, 0.1, 0.0))
    stack = stack.plus(Term("ramp", "v"), (1.0,)).plus(Term("law", "v"), (1.0, 0.0, 1.0))
    assert [part.term.kind for part in stack.parts] == ["law", "ramp", "state"]


TWIN = """
schema = 1
name = "robot"
[model]
kind = "robot1d"
[prediction]
horizon = 4.0
[correction]
channels = ["v"]
terms = ["ramp"]
in_fit = true
[[source]]
name = "robot"
time = { column = "t", unit = "s" }
[source.channels]
v = { column = "v", unit = "m/s" }
x = { column = "x", unit = "m" }
"""


def test_a_twin_file_names_it(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(TWIN)
    rows = drive()
    # a command is recorded when it is given, and holds until the next one
    table = np.column_stack([rows.t * 1e-9, np.roll(rows.u, -1, axis=0), rows.y])
    np.savetxt(tmp_path / "a.csv", table, "%.9g", ",", header="t,v,x", comments="")
    with Twin.open(tmp_path / "robot.toml") as twin:
        found = twin.fit([str(tmp_path / "a.csv")])
    assert [term.kind for term in found.form.terms] == ["ramp"]
    assert found.parameters["ramp.v.rate"].value == pytest.approx(RATE, rel=0.05)
    (tmp_path / "other.toml").write_text(TWIN.replace('["ramp"]', '["rampp"]'))
    with pytest.raises(ConfigError, match="did you mean 'ramp'"):
        Twin.open(tmp_path / "other.toml")


def test_what_is_no_kind_is_refused() -> None:
    with pytest.raises(UsageError, match="expected a CorrectionTerm of that kind"):
        kind("broken")


@pytest.mark.parametrize(
    ("name", "match"),
    [("Half", "neutral: "), ("Beyond", "out of bounds"), ("Silent", "sentence: ")],
)
def test_the_checker_names_the_law_that_is_broken(name: str, match: str) -> None:
    with pytest.raises(LawBroken, match=match):
        check_term(getattr(import_module("own_terms.broken"), name)())
