"""Options that come from a twin file: units are kept until someone knows what they must measure."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from evertwin.config import reads
from evertwin.errors import EvertwinError, UsageError
from evertwin.machines.assembly import assembly
from evertwin.machines.catalog import machine
from evertwin.models import Model, Parameter
from evertwin.settings.quantity import Measured, as_number

FILE = 'schema = 1\nname = "m"\nmodel = {{ kind = "{kind}", options = {options} }}\n'
LINK = 'mass = "2 kg", com = ["-25 cm", 0, 0], inertia = [0.1, 0.1, 0.01]'
TABLE = '{ name = "table", kind = "mass", axis = 1, mass = "10 kg" }'


def moved(moves: str, speed: str = "1 m/s") -> str:
    """A table that follows a path."""
    return (
        f'{{ components = [{TABLE}, {{ name = "p", kind = "controller", axis = 1 }}, '
        f'{{ name = "go", kind = "path", speed = ["{speed}"], acceleration = ["2 m/s^2"], '
        f'moves = [{moves}] }}], reading = "forward" }}'
    )


STEP, WAIT = '{ move = "joints", to = ["3 kg"] }', '{ move = "pause", seconds = "3 m" }'


def built(kind: str, options: str) -> Model:
    twin = reads(FILE.format(kind=kind, options=options))
    return machine(twin.model.kind, twin.model.options)


def test_any_unit_of_the_right_kind_will_do() -> None:
    arm = built(
        "arm", f'{{ dh = [{{ a = "500 mm", alpha = "90 deg", {LINK} }}], width = "1 deg/s" }}'
    )
    assert arm.chain.tool[:3, 3].tolist() == [0.5, 0.0, 0.0]  # type: ignore[attr-defined]
    base = built("differential", '{ wheels = true, wheel_radius = "30 cm", wheel_base = "1 m" }')
    assert base.parameters.values.tolist() == [0.3, 1.0]
    going = built("assembly", moved('{ move = "joints", to = ["50 cm"] }', "200 mm/s"))
    assert going.motion.q[-1].tolist() == [0.5]  # type: ignore[attr-defined]
    axis = built("assembly", f"{{ components = [{TABLE}] }}")
    assert axis.parameters["table.mass"].value == 10.0


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("arm", f'{{ dh = [{{ a = "350 kg", {LINK} }}] }}', "row 1: a: .* in m, got '350 kg'"),
        ("arm", f'{{ dh = [{{ a = "90 deg", {LINK} }}] }}', "row 1: a: .* in m, got '90 deg'"),
        ("arm", f'{{ dh = [{{ {LINK} }}], gravity = [0, 0, "-9.81 m"] }}', "gravity: .* '-9.81 m'"),
        ("arm", f'{{ dh = [{{ {LINK} }}], width = "2 kg" }}', "width: expected a speed"),
        ("arm", f'{{ dh = [{{ {LINK} }}], motor = ["2 kg"] }}', "K1: .* 'Nm/A' .* '2 kg'"),
        ("arm", f'{{ dh = [{{ {LINK} }}], gravty = [0, 0, 1] }}', "did you mean 'gravity'"),
        ("differential", '{ wheels = true, wheel_radius = "3 kg" }', "wheel_radius: .* '3 kg'"),
        ("assembly", '{ components = [{ name = "t", kind = "mass", axis = 1, mass = "3 s" }] }',
         "t.mass: expected a quantity in 'kg' or alike, got '3 s'"),
        ("assembly", f'{{ components = [{TABLE}, {{ name = "g", kind = "guide", axis = 1, '
         'friction = "tanh", width = "1 N" }] }', "'g'.*width: expected a speed"),
        ("assembly", f'{{ components = [{TABLE}], reading = "forward", step = "1 m" }}', "step: "),
        ("assembly", moved("", "1 m"), "'go': speed: .* '1 m'"),
        ("assembly", moved(STEP), "'go': to: .* '3 kg'"),
        ("assembly", moved(WAIT), "'go': path, move 1 .pause.: seconds: .* '3 m'"),
    ],
)  # fmt: skip
def test_a_unit_of_another_kind_is_refused(kind: str, options: str, message: str) -> None:
    with pytest.raises(EvertwinError, match=message):
        built(kind, options)


@pytest.mark.parametrize("line", [1, "table", None, [1]])
def test_what_is_no_component_is_refused(line: Any) -> None:
    with pytest.raises(UsageError, match="components: expected lines such as"):
        assembly([line])


def test_what_is_no_list_of_components_is_refused() -> None:
    with pytest.raises(UsageError, match="components: expected a list of lines"):
        assembly(5)


def test_a_number_remembers_its_unit_in_a_copy() -> None:
    number = as_number("5 cm")
    assert isinstance(number, Measured)
    again = copy.deepcopy(number)
    assert (again, again.written) == (0.05, "5 cm")
    assert type(Parameter("length", number, "m").value) is float
    assert type(Parameter("level", 0.0, "m", high=number).high) is float
