"""From a twin file to its model: the machine by name, parameters and limits as the file says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from evertwin.config.read import place
from evertwin.config.spec import TwinSpec
from evertwin.errors import ConfigError, UsageError
from evertwin.machines.catalog import located, machine
from evertwin.models import FunctionModel, Model, Parameter, Parameters
from evertwin.models.configured import configured
from evertwin.models.functions.translated import translated
from evertwin.rows.channels import check_quantities
from evertwin.settings.quantity import Measured, own
from evertwin.setup.friction_law import check_ladder
from evertwin.signals import Layout
from evertwin.signals.units import conversion, si_unit, to_si


def model_of(spec: TwinSpec, given: Model | None = None, *, compiled: bool = True) -> Model:
    """The base model of a twin: ``given``, or the one that the file names; a plain step as machine
    code if it can, unless it need not be ``compiled``.

    Raises:
        UsageError: no such model, parameter or channel.
        ConfigError: a model in Python that is not where the file says, or a ladder of terms that
            its law does not have.
    """
    model = given or _built(spec, compiled)
    if compiled and type(model) is FunctionModel:
        model = translated(model)
    for one in (*model.inputs, *model.outputs, *model.states):
        if conversion(one.unit) != (1.0, 0.0):
            raise UsageError(
                f"model: {one.name} is in '{one.unit}', and only a FunctionModel may compute in "
                f"other units than SI: state '{si_unit(one.unit)}'"
            )
    check_ladder(spec, model)
    check_quantities(spec, model)
    for name in spec.signals:
        with _placed(spec, "signals", name):
            (model.inputs + model.outputs).index(name)
    return configured(
        model, parameters=_parameters(spec, model), inputs=_limited(spec, model.inputs),
        outputs=_limited(spec, model.outputs),
    )  # fmt: skip


def with_units(spec: TwinSpec, model: Model) -> TwinSpec:
    """The settings, with the unit of a parameter for the indicators that tell of it without one.

    Only a unit that is not SI has to be said: values are kept and compared in SI.
    """
    units = {one.name: one.unit for one in model.parameters if conversion(one.unit) != (1.0, 0.0)}
    rules = []
    for rule in spec.indicator:
        unit = units.get(rule.parameter or "", "")
        if unit and not rule.unit:
            bare = rule.limit is not None and not isinstance(rule.limit, Measured)
            limit = to_si(rule.limit, unit) if bare else rule.limit
            rule = replace(rule, unit=unit, limit=limit)
        rules.append(rule)
    return replace(spec, indicator=tuple(rules)) if units and rules else spec


def _built(spec: TwinSpec, compiled: bool) -> Model:
    with _placed(spec, "model"):
        options = located(spec.folder, spec.model.options)
        return machine(spec.model.kind, options, compiled=compiled)


@contextmanager
def _placed(spec: TwinSpec, *path: str) -> Iterator[None]:
    """What the model refuses is said with its line of the twin file."""
    try:
        yield
    except UsageError as error:
        if type(error) is not UsageError or not spec.file:
            raise
        raise ConfigError(f"{place(spec, path)}: {error}") from error


def _parameters(spec: TwinSpec, model: Model) -> Parameters:
    items = {item.name: item for item in model.parameters}
    for name, said in spec.model.parameters.items():
        changes = {
            key: getattr(said, key)
            for key in ("value", "low", "high", "sigma", "editable", "source")
            if getattr(said, key) is not None
        }
        with _placed(spec, "model", "parameters", name):
            model.parameters.index(name)
            items[name] = _changed(items[name], changes)
    return Parameters(tuple(items.values()))


def _changed(item: Parameter, changes: dict[str, Any]) -> Parameter:
    """A start value beyond the model's own bounds moves the bound that the file leaves open."""
    changes = {
        key: said if isinstance(said, str | bool)
        else own(item.name, said, item.unit, difference=key == "sigma")
        for key, said in changes.items()
    }  # fmt: skip
    value = changes.get("value", item.value)
    if "low" not in changes and value < item.low:
        raise UsageError(f"{item.name}: start value {value:g} is below its bound {item.low:g}")
    if "high" not in changes and value > item.high:
        raise UsageError(f"{item.name}: start value {value:g} is above its bound {item.high:g}")
    return replace(item, **changes)


def _limited(spec: TwinSpec, layout: Layout) -> Layout:
    channels = []
    for channel in layout:
        said = spec.signals.get(channel.name)
        changes = (
            {}
            if said is None
            else {
                key: getattr(said, key)
                for key in ("low", "high", "rate")
                if getattr(said, key) is not None
            }
        )
        channels.append(replace(channel, **changes))
    return Layout(tuple(channels))
