"""From breakdowns to models: levels, laws that complete data, errors with component and line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.config import spec as config
from evertwin.config.read import read
from evertwin.engineering.breakdown import BREAKDOWN, read_breakdown
from evertwin.engineering.compile import ModelPlan, compile_model, estimate
from evertwin.errors import ConfigError, UsageError
from evertwin.machines.arm import Arm
from evertwin.models import LinearModel, check_model
from evertwin.twin import Twin

TWINS = Path(__file__).parents[2] / "twins"
AXIS = """
schema = 1
name = "axis"
[[system]]
name = "drive"
[[system.component]]
name = "motor"
kind = "motor"
axis = 1
effect = 5
proneness = 4
physics = "rotor as a cylinder, constant from the rated point"
data = [{ kind = "kinematic", from = "manual" }]
[system.component.options.estimate]
J = { law = "cylinder", density = 7800, radius = 0.02, length = 0.1 }
k = { law = "rated", torque = 1.2, current = 4.0 }
[system.component.parameters]
k = { low = 0.1, high = 1.0 }
[[system.component]]
name = "screw"
kind = "elastic_ballscrew"
axis = 1
effect = 5
proneness = 4
data = [{ kind = "kinematic", from = "catalogue" }, { kind = "dynamic", from = "catalogue" }]
[system.component.parameters]
lead = 0.02
Fc = { value = 8, source = "literature", cite = "a handbook" }
stiffness = 1e6
[[system.component]]
name = "guide"
kind = "guide"
axis = 1
proneness = 1
interest = false
parameters = { Fc = 20 }
[[system.component]]
name = "table"
kind = "mass"
axis = 1
proneness = 1
parameters = { mass = 95 }
"""


def plan_of(text: str = AXIS, **levels: Any) -> ModelPlan:
    found = BREAKDOWN.parse(text)
    own = dict.fromkeys((part.name for part in found.components), "white")
    return compile_model(found, {**own, **levels})


def test_levels_decide_what_is_modelled() -> None:
    found = compile_model(BREAKDOWN.parse(AXIS))
    assert [(one.component, one.level) for one in found.built] == [
        ("motor", "grey"), ("screw", "white"), ("guide", "black"), ("table", "black"),
    ]  # fmt: skip
    lines: Any = found.options["components"]
    assert [line["name"] for line in lines] == ["motor", "screw", "table"]
    assert "guide.Fc" not in found.parameters
    assert found.parameters["table.mass"]["editable"] is False
    assert found.parameters["screw.Fc"] == {"value": 8.0, "source": "literature: a handbook"}
    check_model(found.model())


def test_a_law_completes_what_is_missing() -> None:
    found = plan_of(motor="grey").parameters
    assert found["motor.J"]["value"] == pytest.approx(0.5 * np.pi * 7800 * 0.1 * 0.02**4)
    assert found["motor.J"]["source"] == "physics: cylinder, density 7800, radius 0.02, length 0.1"
    assert found["motor.k"] == {
        "value": 0.3, "low": 0.1, "high": 1.0, "source": "physics: rated, torque 1.2, current 4",
    }  # fmt: skip


def test_a_black_gearbox_only_transmits() -> None:
    found = plan_of(screw="black")
    lines: Any = found.options["components"]
    assert lines[1] == {"name": "screw", "kind": "ballscrew", "axis": 1, "friction": "none"}
    assert set(found.parameters) >= {"screw.lead"} and "screw.Fc" not in found.parameters
    names = found.model().parameters.names
    assert [name for name in names if name.startswith("screw.")] == ["screw.lead"]


def test_another_kind_of_model_takes_the_parameters_alone() -> None:
    text = AXIS.replace('[[system]]\nname = "drive"', '''[model]
kind = "drive_force"
names = "{parameter}"
[[system]]
name = "drive"''')  # fmt: skip
    kept = text[: text.index('[[system.component]]\nname = "motor"')]
    kept += text[text.index('[[system.component]]\nname = "guide"') :]
    found = plan_of(kept)
    assert found.kind == "drive_force" and dict(found.options) == {}
    assert found.parameters["mass"]["value"] == 95.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('kind = "guide"', 'kind = "gide"', "axis.toml:30: component 'guide': no kind 'gide'"),
        ('kind = "mass"', 'kind = "inertia"',
         "axis.toml:19: component 'screw' gives a translation, 'table' takes a rotation"),
        ("parameters = { mass = 95 }", "parameters = { mas = 95 }",
         "axis.toml:37: component 'table': no parameter 'mas' in the model; there are table.mass"),
        ("parameters = { mass = 95 }", 'parameters = { mass = 95 }\nvirtual = ["colour"]',
         "no virtual sensor 'colour'; there are table.position"),
        ("radius = 0.02, ", "", "component 'motor': J: estimate, law cylinder: needs radius"),
        ('law = "rated"', 'law = "rate"', "axis.toml:6: component 'motor': k: estimate: no law"),
        ('kind = "mass"\n', "", "component 'table': it has parameters, so it needs a kind"),
    ],
)  # fmt: skip
def test_mistakes_name_component_and_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = tmp_path / "axis.toml"
    file.write_text(AXIS.replace(old, new), encoding="utf-8")
    found = read_breakdown(file)
    levels: Any = dict.fromkeys((part.name for part in found.components), "white")
    with pytest.raises(ConfigError, match=said.replace("(", r"\(")):
        compile_model(found, levels, file)


def test_laws_say_what_they_need() -> None:
    wet = {"law": "contact", "materials": ["steel", "bronze"], "normal": 200.0}
    assert estimate(wet).value == pytest.approx(36.0)
    assert estimate({**wet, "lubricated": True, "radius": 0.1}).value == pytest.approx(2.0)
    assert estimate({"law": "block", "density": 1000, "length": 1, "width": 1, "height": 0.01})[0]
    assert estimate({"law": "back-EMF", "voltage": 12.0, "speed": 60.0}).value == 0.2
    assert estimate({"law": "stall", "voltage": 12.0, "current": 6.0}).value == 2.0
    for wrong, said in (
        ({**wet, "materials": ["steel", "cheese"]}, "no coefficient for cheese on steel"),
        ({**wet, "colour": 1}, "no 'colour'; it takes"),
        ({"law": "stall", "voltage": 12.0, "current": 0.0}, "numbers other than 0"),
        ({"law": "stall", "voltage": "x", "current": 1.0}, "expected numbers"),
    ):
        with pytest.raises(UsageError, match=said):
            estimate(wrong)


def welded(rows: int = 690) -> dict[str, np.ndarray]:
    """A cycle of an arm with the friction of the tutorial's machine, and noise."""
    rng = np.random.default_rng(5)
    t = np.arange(rows) * 0.1
    phase = rng.uniform(0, 2 * np.pi, 6)
    w = rng.uniform(0.4, 0.9, 6)
    q = np.array([0.0, -1.2, 1.5, -1.8, -1.57, 0.0]) + 0.5 * np.sin(w * t[:, None] + phase)
    v, a = 0.5 * w * np.cos(w * t[:, None] + phase), -0.5 * w**2 * np.sin(w * t[:, None] + phase)
    truth = Arm.of("ur5_like", law="tanh")
    said = {}
    for j, (fc, fv, rotor) in enumerate(
        zip(
            (12, 14, 10, 3, 3, 2.5),
            (10, 10, 8, 2, 2, 2),
            (1.5, 1.5, 1.2, 0.3, 0.3, 0.3),
            strict=True,
        )
    ):
        said |= {f"Fc{j + 1}": float(fc), f"Fv{j + 1}": float(fv), f"Ia{j + 1}": float(rotor)}
    p = truth.parameters.with_values(said).values
    tau = truth.simulate(np.zeros(0), np.concatenate([q, v, a], axis=1), np.full(rows, 0.1), p)[1]
    tau += rng.normal(size=tau.shape) * [0.5, 0.8, 0.5, 0.08, 0.08, 0.06]
    table = {"t": t}
    for j in range(6):
        table |= {f"q{j + 1}": q[:, j], f"qd{j + 1}": v[:, j], f"qdd{j + 1}": a[:, j]}
        table[f"tau{j + 1}"] = tau[:, j]
    return table


@pytest.mark.slow
def test_the_arms_breakdown_is_a_twin_that_tunes_like_the_arm() -> None:
    """Same start, same data: the same six Coulomb torques and the same verdicts."""
    file = TWINS / "breakdowns" / "arm.toml"
    plan = compile_model(read_breakdown(file), file=file)
    assert isinstance(plan.model(), LinearModel)
    arm = read(TWINS / "arm.toml")
    parameters = {name: config.ParameterSpec(**said) for name, said in plan.parameters.items()}  # type: ignore[arg-type]
    own = config.ModelSpec(plan.kind, dict(plan.options), parameters)
    tuning = config.TuningSpec(editable=("gearbox*.Fc",), window=config.Span(690))
    data = welded()
    with Twin(arm) as one:
        expected = one.fit(data)
    spec = config.TwinSpec(
        **{**{f: getattr(arm, f) for f in arm.__dataclass_fields__}, "model": own, "tuning": tuning}
    )
    with Twin(spec) as other:
        found = other.fit(data)
        verdict = other.run(data)
    for j in range(1, 7):
        assert found.fit[f"gearbox{j}.Fc"] == pytest.approx(expected.fit[f"Fc{j}"], abs=1e-9)
    truth = np.array([12, 14, 10, 3, 3, 2.5])
    assert np.array([found.fit[f"gearbox{j}.Fc"] for j in range(1, 7)]) == pytest.approx(
        truth, rel=0.05
    )
    assert found.train[0].rms == pytest.approx(expected.train[0].rms, rel=1e-9)
    assert verdict is not None


@pytest.mark.slow
@pytest.mark.data
def test_the_feed_axis_breakdown_finds_what_was_published(data_dir: Path) -> None:
    """Mass and friction of a real axis from its components, as the equation of the axis finds."""
    file = TWINS / "breakdowns" / "emps.toml"
    plan = compile_model(read_breakdown(file), file=file)
    axis = read(TWINS / "emps_axis.toml")
    assert {line["name"] for line in plan.options["components"]} == {  # type: ignore[union-attr, index, call-overload]
        "motor", "screw", "guide", "table",
    }  # fmt: skip
    record = data_dir / "emps" / "DATA_EMPS.mat"
    with Twin(axis) as twin:
        fit = twin.fit([record]).fit
    published = {"table.mass": 95.11, "guide.Fv": 203.5, "guide.Fc": 20.39, "guide.offset": -3.16}
    for name, value in published.items():
        assert fit[name] == pytest.approx(value, rel=0.02), name
