"""A model of the user's: what it raises, draws or closes over is told, or serves, as its own."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.app.cli import main
from evertwin.config import spec
from evertwin.errors import ModelError, UsageError
from evertwin.machines import catalog
from evertwin.models.functions.translated import Translated

NOISE = np.random.default_rng(0)


def sound(x: Any, u: Any, dt: float, p: Any) -> Any:
    y = x[0] + dt * p[0] * u[0]
    return [y], [y]


def raising(x: Any, u: Any, dt: float, p: Any) -> Any:
    raise RuntimeError("license server is gone")


def of_three(x: Any, u: Any, p: Any) -> Any:
    return [x[0]], [x[0]]


def silent(x: Any, u: Any, dt: float, p: Any) -> Any:
    pass


def by_name(x: Any, u: Any, dt: float, p: Any) -> Any:
    y = x["x"] + dt * p["gain"] * u["v"]
    return [y], [y]


def bare(x: Any, u: Any, dt: float, p: Any) -> Any:
    y = x[0] + dt * p[0] * u[0]
    return y, y


def sometimes(x: Any, u: Any, dt: float, p: Any) -> Any:
    if u[0] > 0.7:
        raise ValueError("the table ends at 0.7")
    y = x[0] + dt * p[0] * u[0]
    return [y], [y]


def sometimes_plain(x: Any, u: Any, dt: float, p: Any, end: float = 0.7) -> Any:
    if u[0] > end:
        raise ValueError("the table ends at 0.7")
    y = x[0] + dt * p[0] * u[0]
    return [y], [y]


def no_number(x: Any, u: Any, dt: float, p: Any) -> Any:
    above = max(u[0] - 0.7, 0.0)
    y = x[0] + dt * p[0] * u[0] * (1.0 if u[0] <= 0.7 else (above - above) / (above - above))
    return [y], [y]


def no_number_plain(x: Any, u: Any, dt: float, p: Any, end: float = 0.7) -> Any:
    above = np.maximum(u[0] - end, 0.0)
    with np.errstate(invalid="ignore"):
        y = x[0] + dt * p[0] * u[0] * (1.0 if u[0] <= end else (above - above) / (above - above))
    return [y], [y]


def drawing(x: Any, u: Any, dt: float, p: Any) -> Any:
    y = x[0] + dt * p[0] * u[0] + NOISE.normal(0, 1e-3)
    return [y], [y]


def twin_of(step: Callable[..., Any]) -> Twin:
    x = Layout.of(x="m")
    model = FunctionModel(step, Layout.of(v="m/s"), x, x, Parameters.of(gain=(1.0, "1")))
    anomaly = spec.AnomalySpec(requirement=0.01, relative=False, window=spec.Span(100))
    return Twin(
        TwinSpec(
            "cart", spec.ModelSpec("python"), beat=spec.Span(20), anomaly=anomaly,
            prediction=spec.PredictionSpec(horizon=1.0),
        ),
        model,
    )  # fmt: skip


@pytest.fixture
def rows() -> dict[str, Any]:
    """A cart with gain 1.3; 130 of the rows that begin from a known state have v above 0.7."""
    v = np.repeat(np.random.default_rng(0).uniform(0, 1, 40), 10)
    x = np.r_[0.0, np.cumsum(0.1 * 1.3 * v[:-1])] + np.random.default_rng(1).normal(0, 1e-3, 400)
    return {"t": np.arange(400) * 0.1, "v": v, "x": x}


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (raising, r"RuntimeError: license server is gone \(test_users_model.py:\d+\) at v = 0.637"),
        (of_three, "TypeError: of_three.. takes 3 positional arguments but 4 were given"),
        (silent, "two lists of numbers, the states ahead and the outputs, got None"),
        (by_name, "IndexError: only integers"), (bare, "1 states and 1 outputs, got a bare number"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("work", ["fit", "run", "doctor"])
def test_what_fails_at_every_row_is_told_as_the_model_s(
    step: Callable[..., Any], said: str, work: str, rows: dict[str, Any]
) -> None:
    with pytest.raises(ModelError, match=f"{said}.*, on all 399 rows, first at row 1$"):
        getattr(twin_of(step), work)(rows)


@pytest.mark.parametrize("step", [sometimes, sometimes_plain])
def test_rows_that_fail_are_left_out_and_counted(
    step: Callable[..., Any], rows: dict[str, Any]
) -> None:
    twin = twin_of(step)
    assert isinstance(twin.model, Translated) == (step is sometimes)
    found, run, told = twin.fit(rows), twin.run(rows), twin.doctor(rows)
    why = "the model's step raised ValueError: the table ends at 0.7 (test_users_model.py:"
    assert str(found).startswith(why) and "on 130 of 399 rows, first at row 41" in str(found)
    assert found.held is not None and not found.held.reached
    assert "not known at 130 of 399 rows" in str(found.held)
    low, high = found.fit.interval("gain")
    assert low < 1.3 < high and found.fit["gain"] == pytest.approx(1.3, abs=0.005)
    assert run.headline.startswith(why.replace("the", "The", 1)) and "130 of 399" in run.headline
    assert [event.row for event in run.of_kind("model_failed")] == [41]
    for content in (found.to_dict(), run.to_dict()):
        failed: Any = content["model_failed"]
        assert (failed["rows"], failed["of"], failed["first"]) == (130, 399, 41)
        assert failed["reason"].startswith(why)
    assert told.findings[0].kind == "model_failed"


@pytest.mark.parametrize("step", [no_number, no_number_plain])
def test_nan_is_told_with_its_place(step: Callable[..., Any], rows: dict[str, Any]) -> None:
    """0/0 was "the simulation diverged at the start values"."""
    twin = twin_of(step)
    assert isinstance(twin.model, Translated) == (step is no_number)
    found = twin.fit(rows)
    why = "the model's step gives no number (NaN) for x (test_users_model.py:"
    zero = "the model's step raised ZeroDivisionError: float division by zero (test_users_model.py:"
    assert str(found).startswith((why, zero)) and "on 130 of 399 rows, first at row 41" in str(
        found
    )
    assert found.fit["gain"] == pytest.approx(1.3, abs=0.005)


def test_what_a_box_of_an_assembly_raises_is_told(tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text(
        "from evertwin import FunctionModel, Layout, Parameters\n"
        "def step(x, u, dt, p):\n"
        "    if u[0] > 0.12:\n        raise ValueError('the table ends at 0.12')\n"
        "    return [], [p[0] * u[0]]\n"
        "model = FunctionModel(step, Layout.of(v='m/s'), Layout.of(drag='N'),\n"
        "    parameters=Parameters.of(Fv=(100.0, 'Ns/m')))\n"
    )
    inner = {"kind": "python", "options": {"file": str(tmp_path / "drag.py")}}
    box = {"name": "drag", "kind": "black_box", "axis": 1, "inputs": {"v": "speed"}}
    mass = {"name": "table", "kind": "mass", "axis": 1, "mass": 20.0}
    options = {"reading": "forward", "components": [box | {"model": inner}, mass]}
    model = catalog.machine("assembly", options)
    force, x, y = 20.0 * np.sin(2.0 * 0.01 * np.arange(600)), np.zeros(2), np.zeros((600, 2))
    for k in range(1, 600):
        speed = x[1] + 0.01 * (force[k] - 100.0 * x[1]) / 20.0
        x = np.array([x[0] + 0.01 * speed, speed])
        y[k] = x + np.random.default_rng(k).normal(0.0, 1e-4, 2)
    spec_ = TwinSpec(
        "axis", spec.ModelSpec("assembly", options), prediction=spec.PredictionSpec(horizon=0.5)
    )
    rows = {"t": 0.01 * np.arange(600), model.inputs.names[0]: force}
    rows |= dict(zip(model.outputs.names, y.T, strict=True))
    twin = Twin(spec_, model)
    why = "the model's step raised ValueError: the table ends at 0.12 (drag.py:4)"
    assert str(twin.fit(rows)).startswith(why)
    assert twin.run(rows).headline.startswith(why.replace("the", "The", 1))


def test_rows_that_fail_are_told_alike_however_they_come(rows: dict[str, Any]) -> None:
    """Online is batch: the count and the first row are no matter of blocks."""
    with twin_of(sometimes) as twin:
        for k in range(0, 400, 7):
            twin.push({name: column[k : k + 7] for name, column in rows.items()})
        failed = twin.finish().failed
    whole = twin_of(sometimes).run(rows).failed
    assert failed == whole and failed is not None


def test_a_sound_model_says_nothing(rows: dict[str, Any]) -> None:
    twin = twin_of(sound)
    found = twin.fit(rows)
    assert found.failed is None and found.held is not None and found.held.reached
    assert twin.run(rows).failed is None


@pytest.mark.parametrize("command", ["fit --train", "run --data", "doctor --data"])
def test_an_error_of_a_model_in_a_file_is_one_line(
    tmp_path: Path, command: str, rows: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text(
        "from evertwin import FunctionModel, Layout, Parameters\n"
        "def step(x, u, dt, p):\n    raise RuntimeError('license server is gone')\n"
        "model = FunctionModel(step, Layout.of(v='m/s'), Layout.of(x='m'), Layout.of(x='m'),\n"
        "    Parameters.of(gain=(1.0, '1')))\n"
    )
    (tmp_path / "own.toml").write_text(
        'schema = 1\nname = "own"\n[model]\nkind = "python"\noptions = { file = "own.py" }\n'
        '[[source]]\nname = "log"\ntime = { column = "t", unit = "s" }\n'
        'channels.v = { column = "v", unit = "m/s" }\n'
        'channels.x = { column = "x", unit = "m" }\n'
    )
    table = np.column_stack([rows["t"], rows["v"], rows["x"]])
    np.savetxt(tmp_path / "d.csv", table, delimiter=",", header="t,v,x", comments="")
    verb, option = command.split()
    with pytest.raises(SystemExit) as ended:
        main([verb, str(tmp_path / "own.toml"), option, str(tmp_path / "d.csv")])
    (said,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == ModelError.exit_code
    assert "RuntimeError: license server is gone (own.py:3)" in said


def test_a_step_that_draws_numbers_is_not_fitted(rows: dict[str, Any]) -> None:
    for _ in range(3):
        with pytest.raises(ModelError, match="other outputs when the same rows are simulated"):
            twin_of(drawing).fit(rows)
    said = twin_of(drawing).run(rows).headline
    assert "nothing could be tuned: the model gives other outputs" in said


def test_what_an_object_closes_over_is_in_its_machine_code(rows: dict[str, Any]) -> None:
    def closed(share: float) -> Callable[..., Any]:
        def step(x: np.ndarray, u: np.ndarray, dt: float, p: np.ndarray) -> Any:
            moved: float = dt * share * p[0] * u[0]
            return [x[0] + moved], [x[0] + moved]

        return step

    for share in (1.0, 0.5):
        twin = twin_of(closed(share))
        assert isinstance(twin.model, Translated)
        assert twin.fit(rows).fit["gain"] == pytest.approx(1.3 / share, rel=0.005)


class Packages(dict[str, Any]):
    """Entry points as another package registers them."""

    names = property(dict.keys)


def test_a_model_of_another_package(monkeypatch: pytest.MonkeyPatch) -> None:
    def built(start: float = 1.0) -> FunctionModel:
        x = Layout.of(x="m")
        return FunctionModel(sound, Layout.of(v="m/s"), x, x, Parameters.of(gain=(start, "1")))

    def broken() -> FunctionModel:
        raise RuntimeError("license server is gone")

    class Found(NamedTuple):
        factory: Callable[..., Any]

        def load(self) -> Callable[..., Any]:
            return self.factory

    there = Packages(cart=Found(built), broken=Found(broken))
    monkeypatch.setattr(catalog, "entry_points", lambda group: there)
    assert isinstance(catalog.machine("cart", {"start": 2.0}), Translated)
    with pytest.raises(ModelError, match="kind = 'broken': RuntimeError: license server is gone"):
        catalog.machine("broken", {})
    with pytest.raises(UsageError, match="no option 'begin'"):
        catalog.machine("cart", {"begin": 2.0})


def test_the_result_is_json(rows: dict[str, Any]) -> None:
    twin = twin_of(sometimes)
    assert json.loads(json.dumps(twin.fit(rows).to_dict()))["requirement"]["reached"] is False
