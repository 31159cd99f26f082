"""A stack of terms in plain words: what the machine does with its commands.

>>> from evertwin.machines.mobile import Robot1D
>>> law = Term("law", "v", variant="dead zone")
>>> describe(Stack(Robot1D(), (1.0,)).plus(law, (0.06, 0.97, 0.0, 0.16)))
('v: start threshold 0.06 m/s (dead zone), gain 0.97, saturation at 0.16 m/s',)
"""

from __future__ import annotations

from evertwin.correction.stack import Part, Stack
from evertwin.models.form import Term
from evertwin.signals import Layout

__all__ = ["describe"]


def describe(stack: Stack) -> tuple[str, ...]:
    """One sentence per term; quantities in SI."""
    inputs, states = stack.base.inputs, stack.base.states
    return tuple(_sentence(part, inputs, states) for part in stack.parts)


def _sentence(part: Part, inputs: Layout, states: Layout) -> str:
    term, values = part.term, part.values
    layout = states if term.kind == "state" else inputs
    unit = "" if term.channel == "*" else layout.channels[layout.index(term.channel)].unit
    say = {
        "law": _law, "lag": _lag, "coupling": _coupling, "table": _table, "surface": _surface,
        "state": _state,
    }[term.kind]  # fmt: skip
    return say(term, values, unit)


def _law(term: Term, values: tuple[float, ...], unit: str) -> str:
    said = []
    if term.variant:
        said.append(f"start threshold {values[0]:.3g} {unit} ({term.variant})")
        values = values[1:]
    said.append(f"gain {values[0]:.3g}")
    if abs(values[1]) > 5e-3 * values[2]:
        said.append(f"offset {values[1]:.3g} {unit}")
    said.append(f"saturation at {values[2]:.3g} {unit}")
    return f"{term.channel}: " + ", ".join(said)


def _lag(term: Term, values: tuple[float, ...], unit: str) -> str:
    who = "all inputs" if term.channel == "*" else term.channel
    smooth = f" and a first-order lag of {values[1]:.3g} s" if len(values) > 1 else ""
    return f"{who}: delay of {values[0]:.3g} s{smooth}"


def _coupling(term: Term, values: tuple[float, ...], unit: str) -> str:
    c, o = term.channel, term.source
    if term.variant == "grip":
        cap, grip = values[1], values[2]
        limit = (
            f"1/({cap:.3g} + {grip:.3g}·|{o}|)"
            if cap > 1e-6 * grip or grip == 0.0
            else f"{1 / grip:.3g}/|{o}|"
        )
        return f"{c}: gain {values[0]:.3g}, limited to {limit} {unit}"
    size = f"|{o}|" if term.variant == "magnitude" else o
    return f"{c}: {'falls' if values[0] >= 0 else 'rises'} by {abs(values[0]):.3g}·{size}"


def _table(term: Term, values: tuple[float, ...], unit: str) -> str:
    worst = max(abs(v - level) for v, level in zip(values, term.levels, strict=True))
    return f"{term.channel}: table of {len(values)} levels, changes by up to {worst:.3g} {unit}"


def _surface(term: Term, values: tuple[float, ...], unit: str) -> str:
    worst = max(abs(v) for v in values)
    return (
        f"{term.channel}: surface over {term.channel} and {term.source}, up to {worst:.3g} {unit}"
    )


def _state(term: Term, values: tuple[float, ...], unit: str) -> str:
    return (
        f"{term.channel}: exchanges with a hidden state, {values[0]:.3g} 1/s there and "
        f"{values[1]:.3g} 1/s back, which starts {values[2]:+.3g} {unit} apart"
    )
