"""Model file of stores that several inputs fill and that act on each other, in plain equations.

>>> _number(0.000123456, 2), _number(-8.76, 1)
('0.00012', '-9')
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from evertwin.signals import si_unit
from evertwin.starter.numbers.network import FREE, Network, Term, slides

PARTS = {
    "constant": "{n}", "by": "{n} * {0}", "times": "{n} * {0} * {1}", "to": "{n} * {0}",
    "opens": "{n} * {0} * {1}",
}  # fmt: skip
"""What a kind of term adds to what fills its output; and, below, to the share that it loses."""
LOSSES = {
    "leak": "{n}", "to": "{n}", "opens": "{n} * {0}", "drains": "{n} * {0}",
    "drags": "{n} * abs({y})",
}  # fmt: skip
WIDER = 1000.0
"""So many times its start a number reaches at most."""
HEAD = '''"""A machine of your own: put its equations in place of stores that fill and leak."""

import math

from evertwin.models import FunctionModel, Parameter, Parameters
from evertwin.signals import Layout


def step(x, u, dt, p):
    """State x, inputs u, interval dt [s] and parameters p to the next state and the outputs."""
'''
SOLVED = """    # d({y})/dt = gain - loss * {y}
    gain = {gain}
    loss = {loss}
    part = -math.expm1(-loss * dt) / loss if abs(loss * dt) > 1e-9 else dt
    next_{y} = {y} * math.exp(-loss * dt) + gain * part
"""


def network_model(found: Network) -> str:
    """The file's text: numbers start from what the recording says roughly."""
    names = {c: s.name for side in (found.inputs, found.outputs) for c, s in side.items()}
    terms = [term for told in found.equations.values() for term in told]
    lines = [
        f"    {_several(found.inputs, names)} = u", f"    {_several(found.outputs, names)} = x",
        f"    {', '.join(term.name for term in terms)}, = p",
    ]  # fmt: skip
    text = HEAD + "\n".join(lines) + "\n"
    for column, told in found.equations.items():
        text += _solved(found, column, told, names)
    nexts = ", ".join(f"next_{names[column]}" for column in found.outputs)
    sides = (found.inputs, found.outputs)
    layouts = [", ".join(f'{s.name}="{si_unit(s.unit)}"' for s in side.values()) for side in sides]
    rows = "\n".join(_parameters(found))
    return (
        f"{text}    return [{nexts}], [{nexts}]\n\n\nmodel = FunctionModel(\n    step,\n"
        f"    inputs=Layout.of({layouts[0]}),\n"
        f"    outputs=Layout.of({layouts[1]}),  # named like its state, it adopts into it\n"
        f"    states=Layout.of({layouts[1]}),\n    parameters=Parameters(\n        (\n"
        f"            # They start from what the recording says roughly.\n{rows}\n        )\n"
        "    ),\n)\n"
    )


def _several(side: Mapping[str, object], names: Mapping[str, str]) -> str:
    return "".join(f"{names[column]}, " for column in side).rstrip()


def _solved(found: Network, column: str, told: Sequence[Term], names: Mapping[str, str]) -> str:
    """The lines of one output."""
    y = names[column]

    def written(forms: Mapping[str, str]) -> str:
        parts = (
            forms[term.kind].format(*(names[c] for c in term.of), n=term.name, y=y)
            for term in told if term.kind in forms
        )  # fmt: skip
        return " + ".join(parts) or "0.0"

    gain = written(PARTS)
    for term in told:
        if term.kind == "pours":
            of = " * ".join([term.name, *(names[c] for c in term.of)])
            gain += f" - {of} * math.sqrt(max({y}, 0.0))"
        if term.kind == "rubs":
            gain += f" - {term.name} * math.tanh({y} / {slides(found.outputs[column].values)!r})"
    return SOLVED.format(y=y, gain=gain, loss=written(LOSSES))


def _parameters(found: Network) -> Iterator[str]:
    signals = {**found.inputs, **found.outputs}
    for column, told in found.equations.items():
        for term in told:
            y = si_unit(found.outputs[column].unit)
            of = [si_unit(signals[c].unit) for c in term.of]
            unit = _unit(term.kind, y, of)
            size = WIDER * 10.0 ** math.ceil(math.log10(max(abs(term.value), 1e-12)))
            low = -size if term.kind in (*FREE, "constant") else 0.0
            yield (
                f'            Parameter("{term.name}", {_number(term.value)}, "{unit}", '
                f"low={low:g}, high={size:g}),"
            )


def _unit(kind: str, y: str, of: Sequence[str]) -> str:
    """Of a number: of what its term adds to the rate of change of ``y``."""
    if kind == "pours":
        kind, y = "by", y if y == "1" else f"{y}^0.5"
    own = {"opens": [y, *of[:1]], "drains": [y, *of], "drags": [y, y], "to": [y], "leak": [y]}
    over = own.get(kind, [] if kind in ("constant", "rubs") else list(of))
    below = list(over)
    above = y if y not in below else "1"
    if above == "1" and y in below:
        below.remove(y)
    parts = [f"({one})" for one in below if one != "1"]
    return "/".join([above, *parts, "s"])


def _number(value: float, digits: int = 3) -> str:
    return f"{value:.{digits}g}"
