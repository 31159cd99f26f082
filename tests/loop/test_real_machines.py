"""The real axis and the real box, from their twin files through the twin: the figures hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from evertwin.config import read
from evertwin.twin import Twin
from planted.draws import first_of
from planted.twins import opened

pytestmark = pytest.mark.data
TWINS = Path(__file__).parent.parent.parent / "twins"


@pytest.fixture
def record(data_set: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = data_set("emps")
    monkeypatch.setenv("EVERTWIN_DATA", str(folder.parent))
    return folder / "DATA_EMPS.mat"


@pytest.fixture
def box(data_set: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    folder = data_set("incubator")
    monkeypatch.setenv("EVERTWIN_DATA", str(folder.parent))
    september = folder / "20200918_calibration_fan_24V" / "semi_random_movement.csv"
    march = folder / "20210321_lid_opening_7pmodel" / "lid_opening_experiment_mar_2021.csv"
    return september, march


@pytest.fixture
def floor(data_set: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = data_set("robotino")
    monkeypatch.setenv("EVERTWIN_DATA", str(folder.parent))
    return folder / "gray"


def test_what_a_motor_loses_and_what_the_floor_takes_are_told_apart(floor: Path) -> None:
    train, test = (
        [floor / f"exp{number:02}.csv" for number in numbers]
        for numbers in ((4, 52, 100, 124, 160, 182, 208), (89, 121))
    )
    gains = ("gain", "side_gain", "turn_gain")
    one = {"channels": ("set1",)}
    with opened("robotino", correction=one, tuning={"editable": gains}) as twin:
        law = twin.fit(train, test)
    assert [(term.kind, term.channel) for term in law.form.terms] == [("law", "set1")]
    assert law.fit["law.set1.offset"] == pytest.approx(-3.6, abs=2.5)  # behind the steps
    with opened("robotino", correction={"in_fit": False}) as twin:
        load = twin.fit(train, test)
    assert 8.0 < load.fit["load"] < 15.0
    for result in (law, load):
        assert 0.55 < result.fit["gain"] < 0.85 and 0.55 < result.fit["side_gain"] < 0.85
    off, less = ({d.name: d.rms for d in result.test} for result in (law, load))
    assert off["motor1"] < 0.7 * off["motor3"]
    assert less["motor1"] < 0.7 * off["motor3"] and less["motor3"] < 0.7 * off["motor3"]


@pytest.mark.slow
def test_the_axis_has_its_published_parameters(record: Path) -> None:
    with Twin.open(TWINS / "emps.toml") as twin:
        fit = twin.fit([record]).fit
    for name, value in {"mass": 95.11, "Fv": 203.5, "Fc": 20.39, "offset": -3.16}.items():
        assert fit[name] == pytest.approx(value, rel=0.02), name


def test_of_an_offset_and_two_coulomb_frictions_the_simple_ones_are_kept(record: Path) -> None:
    spec = read(TWINS / "emps.toml")
    model = replace(spec.model, options={"law": "sign", "two_sided": True})
    with Twin(replace(spec, model=model)) as twin:
        fit = twin.fit([f"{record}@:16.56"]).fit
    told = dict(zip(fit.names, fit.verdict, strict=True))
    assert told["mass"] == "identifiable" and "not" not in (told["Fc"], told["offset"])
    assert told["Fc_minus"] == "not" and fit["Fc_minus"] == 0.0
    assert "collinear" in fit.reasons[fit.names.index("Fc_minus")]
    assert fit["Fc"] == pytest.approx(20.4, rel=0.05)


@pytest.mark.long  # `proofs.emps` has both directions and the limits
@pytest.mark.slow
def test_the_axis_runs_free_with_the_law_that_pays(record: Path) -> None:
    with Twin.open(TWINS / "emps_free.toml") as twin:
        result = twin.fit([f"{record}@8.28:"], [f"{record}@:8.28"])
    assert result.laws["position"] == "sign+direction"
    assert [d.name for d in result.test] == ["position"]
    assert result.test[0].rms <= 3.7e-3


def test_the_axis_runs_free_with_the_linear_law(record: Path) -> None:
    with Twin.open(TWINS / "emps_linear.toml") as twin:
        result = twin.fit([f"{record}@:16.56"], [f"{record}@16.56:"])
    assert result.test[0].rms <= 6.1e-3


@first_of(
    ("train", "test", "limit"),
    [("march@:1026", "march@1026:2052", 0.06), ("september@:", "march@:2052", 0.25)],
)
def test_the_box_gets_its_extra_state(
    box: tuple[Path, Path], train: str, test: str, limit: float
) -> None:
    paths = dict(zip(("september", "march"), map(str, box), strict=True))
    a, b = ("@".join((paths[w.split("@")[0]], w.split("@")[1])) for w in (train, test))
    spec = read(TWINS / "incubator.toml")
    free = replace(spec, prediction=replace(spec.prediction, horizon=float("inf")))
    with Twin(free) as twin:
        result = twin.fit([a], [b])
    assert [(term.kind, term.channel) for term in result.form.terms] == [("state", "box")]
    assert result.search["after"] < 0.95 * result.search["before"]
    assert set(result.starts[0][0]) == {"heater_start", "state.box.start"}
    assert result.test[0].rms <= limit
    content = result.to_dict()
    assert content["tests"][0]["fitted_to_the_test"][0]["heater_start"] > 250.0  # type: ignore[index,call-overload]


def test_an_arm_that_stands_is_not_judged_and_why(
    data_set: Callable[[str], Path],
) -> None:
    push = data_set("ur10e") / "push" / "ur-20_01_22-push_pose_1.csv"
    with Twin.open(TWINS / "ur10e.toml") as twin:
        result = twin.run(f"{push}@:3")
    assert not result.judged and "unknown" not in result.headline
    assert "cannot be told: tau1 … tau6 are off by 9.7 to 100 %" in result.headline
    assert "What pushes what stands cannot be told" in result.headline


def test_every_lid_is_heard_within_limits_of_september(box: tuple[Path, Path]) -> None:
    with Twin.open(TWINS / "incubator_lid.toml") as twin:
        result = twin.run(list(box))
    heard = [e for e in result.events if e.kind == "suspected"]
    assert len(heard) == 7
    assert not [e for e in result.events if e.kind in ("not_calibrated", "promoted")]
    assert all(e.row > 2347 for e in heard)


def test_the_detector_stands_on_what_september_teaches(box: tuple[Path, Path]) -> None:
    spec = read(TWINS / "incubator_lid.toml")
    free = replace(
        spec, tuning=replace(spec.tuning, editable=None),
        prediction=replace(spec.prediction, horizon=float("inf")),
    )  # fmt: skip
    with Twin(free) as twin:
        fit = twin.fit([box[0]]).fit
    for name, value in zip(fit.names, fit.values.tolist(), strict=True):
        assert spec.model.parameters[name].value == pytest.approx(value, rel=1e-3), name
