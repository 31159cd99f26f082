"""What an FMU says of itself: its variables, its interfaces, its units (FMI 2.0 and 3.0).

Only what a twin needs is kept: numbers of 64 bits. References: Functional Mock-up Interface 2.0.5
and 3.0.2, section "Schema of modelDescription.xml".

>>> text = b'''<fmiModelDescription fmiVersion="2.0" modelName="tank" guid="{1}">
...   <CoSimulation modelIdentifier="tank" canGetAndSetFMUstate="true"/>
...   <ModelVariables><ScalarVariable name="q" valueReference="3" causality="input">
...     <Real start="0.5" unit="m/s"/></ScalarVariable></ModelVariables></fmiModelDescription>'''
>>> tank = parse_description(text, "tank.fmu")
>>> tank.version, tank.variables["q"].reference, tank.interfaces["co-simulation"].saves
('2.0', 3, True)

Reading XML from somebody else: no entities, no document types, no network, bounded in size.

>>> parse(b"<a><b/></a>", "x.xml").tag
'a'
>>> parse(b'<!DOCTYPE a [<!ENTITY e "boom">]><a>&e;</a>', "x.xml")
Traceback (most recent call last):
evertwin.errors.ModelError: x.xml: expected plain XML without document types and entities, got ...
"""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import ParseError

from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from evertwin.errors import ModelError, naming

SIZE = 32_000_000
"""Bytes that a description may have."""
DEPTH = 64
"""Elements inside each other."""
ELEMENTS = 500_000


def parse(text: bytes, where: str) -> Any:
    """The top element; ``where`` opens every message.

    Raises:
        ModelError: the text is no XML, too large or deep, or refers to anything outside of it.
    """
    if len(text) > SIZE:
        raise ModelError(f"{where}: expected at most {SIZE} bytes of XML, got {len(text)}")
    try:
        return _tree(text, where)
    except (ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise ModelError(
            f"{where}: expected plain XML without document types and entities, got {error}"
        ) from error


def _tree(text: bytes, where: str) -> Any:
    depth = count = 0
    top: Any = None
    events = ElementTree.iterparse(io.BytesIO(text), events=("start", "end"), forbid_dtd=True)
    for event, element in events:
        top = element if top is None else top
        depth += 1 if event == "start" else -1
        count += event == "start"
        if depth > DEPTH or count > ELEMENTS:
            raise ModelError(
                f"{where}: expected at most {DEPTH} elements inside each other and {ELEMENTS} in "
                f"all, got more at <{str(element.tag)[:40]}>"
            )
    return top


CO_SIMULATION, MODEL_EXCHANGE = "co-simulation", "model-exchange"
LARGEST = 10_000
"""Elements that one array variable may have."""


@dataclass(frozen=True)
class Unit:
    """A unit that the FMU defines: value in SI base units = factor · value + offset.

    >>> Unit("degC", 1.0, 273.15, (("K", 1),)).exponents
    (('K', 1),)
    """

    name: str
    factor: float = 1.0
    offset: float = 0.0
    exponents: tuple[tuple[str, int], ...] | None = None
    """Powers of base units; None: the FMU does not say."""


@dataclass(frozen=True)
class Variable:
    """One variable of 64 bits, or an array of them.

    >>> Variable("mass", 7).size
    1
    """

    name: str
    reference: int
    """Value reference."""
    causality: str = "local"
    variability: str = "continuous"
    initial: str = ""
    unit: str = ""
    start: tuple[float, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    size: int = 1
    state: str = ""
    """Name of the state that this is the derivative of."""


@dataclass(frozen=True)
class Interface:
    """Co-simulation or model exchange.

    >>> Interface("tank").saves
    False
    """

    identifier: str
    """Name of the shared library."""
    saves: bool = False
    """Can it get and set its state?"""
    serializes: bool = False
    """Can it write this state as bytes?"""
    completes: bool = True
    """Model exchange: does it want to be told of every integrator step?"""


@dataclass(frozen=True)
class Description:
    """All of it.

    >>> Description("2.0", "tank", "{1}").variables
    {}
    """

    version: str
    name: str
    token: str
    """What the library is instantiated with."""
    interfaces: Mapping[str, Interface] = field(default_factory=dict)
    variables: Mapping[str, Variable] = field(default_factory=dict)
    units: Mapping[str, Unit] = field(default_factory=dict)
    states: tuple[str, ...] = ()
    """Continuous states, in the order of the derivatives."""
    indicators: int = 0
    """Event indicators."""
    step: float = 0.0
    """Default step [s]; 0: not said."""


def parse_description(text: bytes, where: str) -> Description:
    """Reads a ``modelDescription.xml``; ``where`` opens every message.

    Raises:
        ModelError: it is of another version, or does not say what it must.
    """
    top = parse(text, where)
    with naming(where, ModelError, ModelError):
        return _description(top)


def _description(top: Any) -> Description:
    version = str(top.get("fmiVersion", "")) if top.tag == "fmiModelDescription" else ""
    if not version.startswith(("2.", "3.")):
        raise ModelError(
            f"expected an FMU of FMI 2.0 or 3.0, got "
            f"{f'FMI {version}' if version else f'<{str(top.tag)[:40]}>'}: export it again"
        )
    three = version.startswith("3")
    types = _types(top)
    variables = _variables(top, types, three=three)
    found = {v.name: v for v in variables if v is not None}
    interfaces = _interfaces(top)
    if not interfaces:
        raise ModelError("expected CoSimulation or ModelExchange, got neither")
    states, indicators = _structure(top, variables, three=three)
    experiment = top.find("DefaultExperiment")
    step = _number(experiment, "stepSize", 0.0) if experiment is not None else 0.0
    token = str(top.get("instantiationToken" if three else "guid", ""))
    return Description(
        version[:3], str(top.get("modelName", "")), token, interfaces, found, _units(top),
        states, indicators, step if step > 0 else 0.0,
    )  # fmt: skip


def _number(element: Any, key: str, default: float) -> float:
    text = element.get(key)
    if text is None:
        return default
    try:
        return float(text)
    except ValueError as error:
        raise ModelError(
            f"<{element.tag} name={element.get('name')!r}>: expected a number as {key}, "
            f"got {text[:40]!r}"
        ) from error


def _whole(element: Any, key: str) -> int:
    value = _number(element, key, math.nan)
    if not (value >= 0 and value == math.floor(value) and value < 2**32):
        raise ModelError(
            f"<{element.tag} name={element.get('name')!r}>: expected a whole number as "
            f"{key}, got {element.get(key)!r}"
        )
    return int(value)


def _true(element: Any, *keys: str) -> bool:
    return any(element.get(key) in ("true", "1") for key in keys)


def _interfaces(top: Any) -> dict[str, Interface]:
    found = {}
    for tag, name in (("CoSimulation", CO_SIMULATION), ("ModelExchange", MODEL_EXCHANGE)):
        element = top.find(tag)
        if element is None:
            continue
        identifier = str(element.get("modelIdentifier", ""))
        if not identifier or not identifier.replace("_", "a").isalnum():
            raise ModelError(
                f"<{tag}>: expected a modelIdentifier of letters, digits and _, got "
                f"{identifier[:80]!r}"
            )
        found[name] = Interface(
            identifier,
            saves=_true(element, "canGetAndSetFMUstate", "canGetAndSetFMUState"),
            serializes=_true(element, "canSerializeFMUstate", "canSerializeFMUState"),
            completes=not _true(element, "completedIntegratorStepNotNeeded")
            and element.get("needsCompletedIntegratorStep", "true") in ("true", "1"),
        )
    return found


def _types(top: Any) -> dict[str, Any]:
    """Declared types by name: elements with unit, min and max."""
    found = {}
    for element in top.iterfind("TypeDefinitions/*"):
        inner = element.find("Real") if element.tag == "SimpleType" else element
        if inner is not None and element.get("name"):
            found[str(element.get("name"))] = inner
    return found


def _variables(top: Any, types: Mapping[str, Any], *, three: bool) -> list[Variable | None]:
    """In the order of the file; None for what is no number of 64 bits."""
    elements = list(top.iterfind("ModelVariables/*"))
    names = [str(element.get("name", "")) for element in elements]
    for name, count in Counter(names).items():
        if not name or count > 1:
            raise ModelError(f"expected each variable with a name of its own: {name!r}")
    referred = {str(e.get("valueReference")): e for e in elements}
    found: list[Variable | None] = []
    for element in elements:
        real = (element if element.tag == "Float64" else None) if three else element.find("Real")
        if real is None:
            found.append(None)
            continue
        state = ""
        if real.get("derivative") is not None:
            place = _whole(real, "derivative")
            if three and str(place) in referred:
                state = str(referred[str(place)].get("name"))
            elif not three and 0 < place <= len(names):
                state = names[place - 1]
        size = _size(element, referred) if three else 1
        found.append(_variable(element, real, types, (size, state)))
    return found


def _variable(
    element: Any, real: Any, types: Mapping[str, Any], shape: tuple[int, str]
) -> Variable:
    declared = types.get(str(real.get("declaredType", "")), real)

    def said(key: str) -> Any:
        return real if real.get(key) is not None else declared

    start = str(real.get("start", "")).split()
    try:
        values = tuple(float(word) for word in start)
    except ValueError as error:
        raise ModelError(
            f"variable {element.get('name')!r}: expected a number as start, got "
            f"{real.get('start')[:40]!r}"
        ) from error
    low, high = _number(said("min"), "min", -math.inf), _number(said("max"), "max", math.inf)
    return Variable(
        str(element.get("name")), _whole(element, "valueReference"),
        str(element.get("causality", "local")), str(element.get("variability", "continuous")),
        str(element.get("initial", "")), str(said("unit").get("unit", "")), values, low, high,
        *shape,
    )  # fmt: skip


def _size(element: Any, referred: Mapping[str, Any]) -> int:
    """Elements of an array (FMI 3); a dimension may be the start value of another variable."""
    size = 1
    for dimension in element.iterfind("Dimension"):
        if dimension.get("start") is not None:
            size *= _whole(dimension, "start")
        else:
            source = referred.get(str(dimension.get("valueReference")))
            size *= 0 if source is None else _whole(source, "start")
    if not 1 <= size <= LARGEST:
        raise ModelError(
            f"variable {element.get('name')!r}: expected 1 to {LARGEST} elements, got {size}"
        )
    return size


def _structure(
    top: Any, variables: list[Variable | None], *, three: bool
) -> tuple[tuple[str, ...], int]:
    """Continuous states, and how many event indicators there are."""
    if three:
        by_reference = {v.reference: v for v in variables if v is not None}
        elements = list(top.iterfind("ModelStructure/ContinuousStateDerivative"))
        found = [by_reference.get(_whole(e, "valueReference")) for e in elements]
        indicators = len(list(top.iterfind("ModelStructure/EventIndicator")))
    else:
        places = [_whole(e, "index") - 1 for e in top.iterfind("ModelStructure/Derivatives/*")]
        found = [variables[k] if 0 <= k < len(variables) else None for k in places]
        indicators = int(_number(top, "numberOfEventIndicators", 0.0))
    states = tuple("" if v is None else v.state for v in found)
    names = {v.name for v in variables if v is not None}
    if not set(states) <= names or not 0 <= indicators <= LARGEST:
        raise ModelError("<ModelStructure>: expected derivatives of states that the FMU lists")
    return states, indicators


def _units(top: Any) -> dict[str, Unit]:
    found = {}
    for element in top.iterfind("UnitDefinitions/Unit"):
        name = str(element.get("name", ""))
        base = element.find("BaseUnit")
        if base is None:
            found[name] = Unit(name)
            continue
        powers = tuple(
            (key, int(_number(base, key, 0.0)))
            for key in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
            if _number(base, key, 0.0)
        )
        found[name] = Unit(name, _number(base, "factor", 1.0), _number(base, "offset", 0.0), powers)
    return found
