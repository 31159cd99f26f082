"""A function in units of its own does what its twin in SI does, and is told of in its units."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin import Twin
from evertwin.ahead.basis import Future
from evertwin.ahead.changes import Case, changed
from evertwin.ahead.spec import read_scenario
from evertwin.config import read
from evertwin.errors import ConfigError, UsageError
from evertwin.machines.catalog import machine
from evertwin.machines.python_file import model_from_file
from evertwin.models import FunctionModel, Parameter, Parameters, check_model
from evertwin.models.functions.translated import Translated, translated
from evertwin.setup import with_units
from evertwin.signals import Channel, Layout

FILE = """
import math
from evertwin import FunctionModel, Layout, Parameter, Parameters
{turn}
def step(x, u, dt, p):
    n0, t0, h0 = x[0] / N, x[1] - K, x[2] / BAR
    q, p0, c = u[1] * Q, p[1] / BAR, p[2] / BAR
    n = n0 + (p[0] * u[0] / N - n0) * (1.0 - math.exp(-dt / 5.0))
    press = p0 + c * (n / 1500.0) ** 2 - 0.0005 * q * q
    t = t0 + dt * (1e-5 * n - 0.004 * (t0 - (u[2] - K)) * q / 40.0)
    hidden = h0 + dt / 60.0 * (press - h0)
    y = [n * N, press * BAR, t + K, 0.5 * hidden * BAR]
    return [n * N, t + K, hidden * BAR], y

model = FunctionModel(
    step, Layout.of(sp="{rpm}", q="{flow}", room="{warm}"),
    Layout.of(n="{rpm}", press="{bar}", temp="{warm}", back="{bar}"),
    Layout.of(n="{rpm}", temp="{warm}", hidden="{bar}"),
    Parameters((
        Parameter("ratio", 0.9, "1"), Parameter("p0", 1.0 * BAR, "{bar}", 0.0, 10.0 * BAR),
        Parameter("c", 3.0 * BAR, "{bar}", 0.0, 20.0 * BAR),
        Parameter("start", 2.0 * BAR, "{bar}", 0.0, 20.0 * BAR),
    )),
    start=(800.0 * N, 55.0 + K, "start"),
)
"""
OWN = {"turn": "N, Q, K, BAR = 1.0, 1.0, 0.0, 1.0", "rpm": "rpm", "flow": "m^3/h", "bar": "bar",
       "warm": "degC"}  # fmt: skip
SI = {"turn": "N, Q, K, BAR = math.pi / 30.0, 3600.0, 273.15, 1e5", "rpm": "rad/s",
      "flow": "m^3/s", "bar": "Pa", "warm": "K"}  # fmt: skip
TWIN = """schema = 1
name = "pump"
beat = 50
[model]
kind = "python"
options = {{ file = "{0}.py" }}
[model.parameters]
c = {{ value = "2900 mbar", high = "15 bar" }}
p0 = {{ value = 0.9, unit = "bar", sigma = 2.0 }}
[[source]]
name = "log"
files = ["d.csv"]
time = {{ column = "t" }}
[source.channels]
sp = {{ column = "sp", unit = "rpm" }}
q = {{ column = "q", unit = "m^3/h" }}
room = {{ column = "room", unit = "degC" }}
n = {{ column = "n", unit = "rpm" }}
press = {{ column = "press", unit = "bar" }}
temp = {{ column = "temp", unit = "degC" }}
back = {{ column = "back", unit = "bar" }}
[prediction]
horizon = "60 s"
[anomaly]
requirement = 0.05
window = 300
[[indicator]]
name = "wear"
parameter = "c"
direction = "below"
limit = {1}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pump")
    rng = np.random.default_rng(3)
    n, q, sp = (
        1500,
        np.repeat(rng.uniform(20, 60, 20), 75),
        np.repeat(rng.uniform(600, 1500, 30), 50),
    )
    speed, temp, hidden, rows = 0.0, 60.0, 3.0, []
    for k in range(n):
        speed += (0.98 * sp[k] - speed) * (1 - math.exp(-0.2))
        press = 1.5 + 4.0 * (speed / 1500) ** 2 - 0.0005 * q[k] ** 2
        temp += 1e-5 * speed - 0.004 * (temp - 22.0) * q[k] / 40.0
        hidden += (press - hidden) / 60.0
        off = rng.normal(0.0, (2.0, 0.01, 0.05, 0.01))
        rows.append([k, sp[k], q[k], 22.0, *np.array([speed, press, temp, hidden / 2]) + off])
    np.savetxt(folder / "d.csv", rows, delimiter=",", header="t,sp,q,room,n,press,temp,back",
               comments="", fmt="%.5f")  # fmt: skip
    for name, units in (("own", OWN), ("si", SI)):
        (folder / f"{name}.py").write_text(FILE.format(**units))
        (folder / f"{name}.toml").write_text(TWIN.format(name, '"2 bar"'))
    return folder


def both(made: Path) -> tuple[Any, Any]:
    return tuple(machine("python", {"file": str(made / one)}) for one in ("own.py", "si.py"))


def test_a_function_in_its_own_units_computes_what_its_twin_in_si_does(made: Path) -> None:
    own, si = both(made)
    assert isinstance(own, Translated) and isinstance(si, Translated)
    assert own.inputs.units == si.inputs.units == ("rad/s", "m^3/s", "K")
    assert own.outputs.units == si.outputs.units == ("rad/s", "Pa", "K", "Pa")
    u = np.tile([120.0, 0.01, 295.0], (40, 1))
    found = [m.simulate(m.initial(m.parameters.values), u, np.ones(40), m.parameters.values)
             for m in (own, si)]  # fmt: skip
    for a, b in zip(*found, strict=True):
        assert a == pytest.approx(b, rel=1e-9)
    plain = FunctionModel(own.step, own.inputs, own.outputs, own.states, own.parameters, own.start)
    p = plain.parameters.values
    slow = plain.simulate(plain.initial(p), u, np.ones(40), p)
    assert slow[1] == pytest.approx(found[0][1], rel=1e-12)
    check_model(plain)
    check_model(own)


def test_the_same_is_found_and_told_in_the_stated_unit(made: Path) -> None:
    with Twin.open(made / "own.toml") as own, Twin.open(made / "si.toml") as si:
        a, b = own.fit(), si.fit()
        one, other = a.fit, b.fit
        assert one.units == tuple("bar" if unit == "Pa" else unit for unit in other.units)
        assert one.verdict == other.verdict
        sizes = np.where(np.array(other.units) == "Pa", 1e5, 1.0)
        assert one.values * sizes == pytest.approx(other.values, rel=1e-5)
        assert one["c"] == pytest.approx(4.0, rel=0.02)
        assert [d.told for d in a.train] == [
            (pytest.approx(d.told[0], rel=1e-4), d.told[1]) for d in b.train
        ]
        first, second = own.run(), si.run()
    assert [(e.row, e.kind, e.signal) for e in first.events] == [
        (e.row, e.kind, e.signal) for e in second.events
    ]
    tuned = next(e.reason for e in first.events if e.kind == "tuned")
    assert "bar" in tuned and "Pa" not in tuned
    assert first.champion.number == second.champion.number
    assert first.outputs["press"].rms_after == pytest.approx(second.outputs["press"].rms_after)


@pytest.mark.parametrize("limit", ['"2 bar"', "2.0"])
def test_an_indicator_is_told_in_the_unit_of_its_parameter(made: Path, limit: str) -> None:
    place = made / "limit.toml"
    place.write_text(TWIN.format("own", limit))
    (rule,) = with_units(read(place), both(made)[0]).indicator
    assert (rule.unit, rule.limit) == ("bar", 2e5)
    with Twin.open(place) as twin:
        twin.run()
        found = twin.life().indicators[0].indicator
    assert found.unit == "bar" and found.limit.value == pytest.approx(2.0)
    assert found.value[-1] == pytest.approx(4.0, rel=0.05)


def test_settings_of_a_parameter_are_in_its_unit(made: Path) -> None:
    with Twin.open(made / "own.toml") as twin:
        item, other = twin.model.parameters["c"], twin.model.parameters["p0"]
        assert (item.value, item.low, item.high) == (2.9, 0.0, 15.0)
        assert (other.value, other.sigma) == (0.9, 2.0)
        scenario = made / "s.toml"
        said = 'schema = 1\nname = "s"\n[parameters]\nc = "3300 mbar"\np0 = { add = 0.1 }\n'
        scenario.write_text(said)
        p, nothing = twin.model.parameters.values, Future(np.zeros((1, 3)), np.ones(1))
        case = Case(twin.model, p, 0.0 * p, nothing)
        after = changed(twin.prospect().basis, case, read_scenario(scenario)).p
    assert after[2] == 3.3 and after[1] == pytest.approx(1.0)


def test_a_temperature_is_stated_with_its_zero_and_a_spread_without() -> None:
    from evertwin.settings.quantity import Measured, own

    assert own("t", Measured(294.45, "21.3 degC"), "degC") == 21.3
    assert own("t", Measured(294.45, "294.45 K"), "degC") == pytest.approx(21.3)
    assert own("t", Measured(0.5, "0.5 K"), "degC", difference=True) == 0.5


def test_what_is_in_si_is_left_as_it_is() -> None:
    layout, values = Layout.of(v="m/s", heading="rad", share="1"), np.ones(3)
    assert layout.in_si() == layout
    assert layout.to_stated(values) is values and layout.from_stated(values) is values
    assert Parameter("a", 2.0, "m").value == 2.0


def test_limits_of_a_channel_are_converted_with_it() -> None:
    told = Channel("t", "degC", low=-10.0, high=90.0, rate=2.0).in_si()
    assert (told.unit, told.stated) == ("K", "degC")
    assert (told.low, told.high, told.rate) == (263.15, 363.15, 2.0)


def test_columns_by_name_are_in_the_units_that_the_model_states() -> None:
    from evertwin.config.spec import AnomalySpec, ModelSpec, TwinSpec

    model = FunctionModel(
        lambda x, u, dt, p: ([], [p[0] + p[1] * u[0]]), Layout.of(q="m^3/h"),
        Layout.of(press="bar"), parameters=Parameters.of(a=(1.0, "bar"), b=(0.1, "1")),
    )  # fmt: skip
    q = np.linspace(20.0, 60.0, 300) + 10.0 * np.sin(np.arange(300.0))
    spec = TwinSpec("pump", ModelSpec("python"), anomaly=AnomalySpec(requirement=0.05))
    with Twin(spec, model) as twin:
        found = twin.fit({"t": np.arange(300.0), "q": q, "press": 2.0 + 0.05 * q})
    assert found.fit["a"] == pytest.approx(2.0) and found.fit["b"] == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("unit", "recorded", "said"),
    [
        ("bar", "1", "is in '1', and the model's 'press' in 'bar'"),
        ("bar", "K", "is in 'K', and the model's 'press' in 'bar'"),
        ("1/min", "rpm", "the model may count turns or radians"),
    ],
)
def test_a_recording_in_a_unit_that_cannot_be_converted_is_refused(
    made: Path, unit: str, recorded: str, said: str
) -> None:
    bare = TWIN.format("other", '"2 bar"').replace(
        'press = { column = "press", unit = "bar" }',
        f'press = {{ column = "press", unit = "{recorded}" }}',
    )
    (made / "other.toml").write_text(bare)
    (made / "other.py").write_text(FILE.format(**OWN).replace('press="bar"', f'press="{unit}"'))
    with pytest.raises(ConfigError, match=said):
        Twin.open(made / "other.toml")


def test_a_unit_that_nobody_knows_is_one_error(made: Path) -> None:
    (made / "wrong.py").write_text(FILE.format(**{**OWN, "bar": "barr"}))
    with pytest.raises(ConfigError, match=r"wrong.py:\d+: UsageError: unit: 'barr' is not known"):
        model_from_file(str(made / "wrong.py"))


def test_a_state_and_the_parameter_it_starts_from_measure_the_same() -> None:
    def step(x: Any, u: Any, dt: float, p: Any) -> Any:
        return [x[0]], [x[0]]

    for unit in ("K", "1"):
        with pytest.raises(UsageError, match="the state level is in 'bar', and the parameter"):
            FunctionModel(step, Layout(), Layout.of(y="bar"), Layout.of(level="bar"),
                          Parameters.of(begin=(1.0, unit)), ("begin",))  # fmt: skip
    model = FunctionModel(step, Layout(), Layout.of(y="bar"), Layout.of(level="bar"),
                          Parameters.of(begin=(300.0, "mbar")), ("begin",))  # fmt: skip
    assert model.initial(model.parameters.values).tolist() == [30000.0]


def test_machine_code_knows_by_which_units_it_was_made() -> None:
    def layout(unit: str) -> tuple[Layout, Layout]:
        return Layout.of(a=unit), Layout.of(b=unit)

    found = [translated(FunctionModel(_twice, *layout(unit))) for unit in ("K", "degC", "bar")]
    u = np.array([[300.0]])
    got = [m.simulate(np.zeros(0), u, np.ones(1), np.zeros(0))[1].item() for m in found]
    assert all(isinstance(m, Translated) for m in found)
    assert got == pytest.approx([600.0, 273.15 + 2 * 26.85, 600.0])


def _twice(x: Any, u: Any, dt: float, p: Any) -> Any:
    return [], [2.0 * u[0]]


def test_a_model_that_is_no_function_has_to_be_in_si() -> None:
    from evertwin.config.spec import ModelSpec, TwinSpec

    class Gauge:
        inputs, outputs, states = Layout.of(u="1"), Layout.of(p="bar"), Layout()
        parameters = Parameters()

        def initial(self, p: Any) -> Any:
            return np.zeros(0)

        def simulate(self, x: Any, u: Any, dt: Any, p: Any) -> Any:
            return x, u

        def observe(self, x: Any, y: Any) -> Any:
            return x

    with pytest.raises(UsageError, match=r"p is in 'bar', and only a FunctionModel .* 'Pa'"):
        Twin(TwinSpec("gauge", ModelSpec("python")), Gauge())


def test_an_fmu_says_what_the_unit_of_a_parameter_is(made: Path) -> None:
    from evertwin.machines.catalog import machine

    with Twin.open(made / "own.toml") as twin:
        twin.export(made / "own.fmu", "fmu")
        model, u = twin.model, np.tile([120.0, 0.01, 295.0], (5, 1))
    options = {"memory": "start", "states": ["state.n", "state.temp", "state.hidden"],
               "adopts": {"n": "state.n", "temp": "state.temp"}}  # fmt: skip
    fmu = machine("fmu", {"file": str(made / "own.fmu"), **options})
    item = fmu.parameters["c"]
    assert (item.value, item.unit) == (pytest.approx(2.9e5), "Pa")
    p = fmu.parameters.values
    start = fmu.initial(p)  # where the recording ends
    own = model.simulate(start, u, np.ones(5), model.parameters.values)[1]
    assert fmu.simulate(start, u, np.ones(5), p)[1] == pytest.approx(own, rel=1e-9)
