"""What a stranger machine is: its textbook description, its recordings and its true form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Columns = dict[str, np.ndarray]
Numbers = dict[str, float]
Own = Callable[[Columns, Numbers, Numbers], Columns]


@dataclass(frozen=True)
class Nominal:
    """The textbook model that an engineer would give a twin of the machine."""

    form: str  # "cart", "base", "drive" or "tank"
    parameters: Numbers  # nominal numbers, each 5-30 % wrong
    roles: dict[str, str]  # symbol in the textbook form -> column name
    text: str  # the form as an equation, in the machine's own column names


@dataclass(frozen=True)
class Machine:
    """One drawn machine. Commands hold from a row to the next; outputs belong to their row."""

    nominal: Nominal
    recordings: list[Columns]
    inputs: list[str]
    outputs: list[str]
    units: dict[str, str]
    own: Own  # own(inputs with 't', start, parameters) -> outputs: the true form
    own_start: Numbers  # rough parameters to start a fit of the true form
    own_true: Numbers
    noise: Numbers  # standard deviation per output
    starts: list[Numbers]  # true start per recording: outputs, and hidden states if any
    horizon: float  # seconds over which a prediction of this machine is worth judging


TEXTS: dict[str, str] = {
    "cart": "{x}' = gain * {v}",
    "base": "{x}' = gv * {v} * cos({heading}); {y}' = gv * {v} * sin({heading}); "
    "{heading}' = gw * {w}",
    "drive": "{force} = M * {acc} + Fv * {vel} + Fc * sign({vel}) + offset",
    "tank": "{x}' = (k * {u} - {x} + offset) / tau",
}


def nominal(form: str, roles: dict[str, str], parameters: Numbers) -> Nominal:
    """The textbook description of `form` in the column names given by `roles`."""
    return Nominal(form, parameters, roles, TEXTS[form].format(**roles))


def measure(
    rng: np.random.Generator,
    own: Own,
    true: Numbers,
    inputs: Sequence[Columns],
    starts: Sequence[Numbers],
    noise: Numbers,
) -> list[Columns]:
    """Run the true form on each set of inputs and add sensor noise to its outputs."""
    recordings = []
    for columns, start in zip(inputs, starts, strict=True):
        clean = own(columns, start, true)
        seen = {
            name: value + rng.normal(0.0, noise[name], value.size) for name, value in clean.items()
        }
        recordings.append({**columns, **seen})
    return recordings
