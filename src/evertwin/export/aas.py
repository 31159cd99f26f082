"""A version as an asset administration shell: one shell, four submodels, JSON or AASX.

    Nameplate              what the twin is of: name, kind of model, version and its hash
    TechnicalData          every parameter: value, unit, bounds, where it is from; channels
    OperationalData        of recordings that go along: span, and what each output is off by
    PredictiveMaintenance  what moved: tuned values, intervals, ratio to the configured; alarms

The identifiers are evertwin's own. They are no templates of the IDTA: those ask for what a twin
file does not know, a manufacturer's address or a serial number.

>>> short("Fc1"), short("2nd.gain"), short("v.law#2")
('Fc1', 'x2nd_gain', 'v_law_2')
"""

from __future__ import annotations

import importlib
import io
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.errors import UsageError, needs
from evertwin.export.content import Exported
from evertwin.files import write_whole

SPACE = "urn:evertwin:aas"
LONGEST = 128
"""Characters of a short name."""


def short(name: str) -> str:
    """A name as a shell allows it: letters, digits, underscores, a letter first."""
    word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return (word if word[:1].isalpha() else f"x{word}")[:LONGEST]


def write_aas(out: Exported, path: Path) -> str:
    """Writes ``.json`` or ``.aasx``; what a reader has to know.

    Raises:
        UsageError: another ending, or two names become the same.
        MissingExtra: basyx-python-sdk is not installed.
    """
    if path.suffix not in (".json", ".aasx"):
        raise UsageError(f"{path.name}: expected a name that ends with .json or .aasx")
    shell, submodels = _shell(out)
    store = _basyx("model").DictIdentifiableStore([shell, *submodels])
    if path.suffix == ".json":
        text = io.StringIO()
        _basyx("adapter.json").write_aas_json_file(text, store)
        write_whole(path, text.getvalue())
    else:
        with io.BytesIO() as raw:
            package = _basyx("adapter.aasx")
            with package.AASXWriter(raw) as writer:
                writer.write_aas(shell.id, store, package.DictSupplementaryFileContainer())
            write_whole(path, raw.getvalue())
    return "identifiers are evertwin's own, not those of IDTA templates"


def _shell(out: Exported) -> tuple[Any, list[Any]]:
    model = _basyx("model")
    asset = f"{SPACE}:{short(out.name)}"
    parts = {
        "Nameplate": _nameplate(out), "TechnicalData": _technical(out),
        "OperationalData": _operational(out), "PredictiveMaintenance": _maintenance(out),
    }  # fmt: skip
    submodels = [
        model.Submodel(
            f"{asset}:{name}", content, id_short=name,
            semantic_id=model.ExternalReference(
                (model.Key(model.KeyTypes.GLOBAL_REFERENCE, f"{SPACE}:{name}:1"),)
            ),
        )
        for name, content in parts.items()
    ]  # fmt: skip
    about = model.AssetInformation(model.AssetKind.INSTANCE, global_asset_id=asset)
    named = {model.ModelReference.from_referable(one) for one in submodels}
    return model.AssetAdministrationShell(
        about, f"{asset}:shell", id_short=short(out.name), submodel=named
    ), submodels


def _nameplate(out: Exported) -> list[Any]:
    version = out.version
    return _values({
        "Name": out.name, "ModelKind": out.kind, "Version": version.number, "Hash": version.hash,
        "Reason": version.reason,
    })  # fmt: skip


def _technical(out: Exported) -> list[Any]:
    parameters = {name: {k: one[k] for k in ("value", "unit", "low", "high", "source")}
                  for name, one in out.parameters.items()}  # fmt: skip
    channels = {f"{end}s": {one["name"]: {"unit": one["unit"]} for one in out.channels(layout)}
                for end, layout in (("Input", out.model.inputs),
                                    ("Output", out.model.outputs))}  # fmt: skip
    return [_group("Parameters", parameters), *(_group(k, v) for k, v in channels.items())]


def _operational(out: Exported) -> list[Any]:
    rows = out.trajectories
    if rows is None:
        return _values({"Rows": 0})
    off = {}
    for k, one in enumerate(out.channels(out.model.outputs)):
        wrong = rows.measured[:, k] - rows.predicted[:, k]
        known = wrong[np.isfinite(wrong)]
        rms = float(np.sqrt(np.mean(known**2))) if len(known) else None
        off[one["name"]] = {"unit": one["unit"], "rows": len(known), "rmse": rms}
    told = {"Rows": len(rows.t), "Seconds": float(rows.t[-1] - rows.t[0])}
    return [*_values(told), _group("Residuals", off)]


def _maintenance(out: Exported) -> list[Any]:
    moved = {}
    for name, one in out.parameters.items():
        if one["interval95"] is not None:
            low, high = one["interval95"]
            ratio = one["value"] / one["as_configured"] if one["as_configured"] else None
            moved[name] = {"value": one["value"], "unit": one["unit"], "low95": low,
                           "high95": high, "verdict": one["verdict"],
                           "ratio_to_configured": ratio}  # fmt: skip
    alarms = {f"Alarm{k}": {"component": event.signal, "reason": event.reason, "time": event.time}
              for k, event in enumerate(out.alarms, start=1)}  # fmt: skip
    return [_group("Tuned", moved), _group("Alarms", alarms)]


def _group(name: str, content: Mapping[str, Mapping[str, object]]) -> Any:
    """A collection of collections; each keeps its name as it is."""
    known: dict[str, str] = {}
    for one in content:
        if short(one) in known:
            raise UsageError(f"aas: {known[short(one)]!r} and {one!r} become the same name")
        known[short(one)] = one
    collection = _basyx("model").SubmodelElementCollection
    inside = (collection(short(one), _values({"name": one, **told}))
              for one, told in content.items())  # fmt: skip
    return collection(name, inside)


def _values(told: Mapping[str, object]) -> list[Any]:
    """Properties; what is not known has none."""
    model = _basyx("model")
    known = {name: value for name, value in told.items() if value not in (None, "")}
    return [
        model.Property(short(name), _kind(value), value) for name, value in known.items()
        if not (isinstance(value, float) and math.isnan(value))
    ]  # fmt: skip


def _kind(value: object) -> Any:
    types = _basyx("model.datatypes")
    return {bool: types.Boolean, int: types.Long, float: types.Double}.get(
        type(value), types.String
    )  # fmt: skip


def _basyx(module: str) -> Any:
    with needs("aas", "basyx-python-sdk"):
        return importlib.import_module(f"basyx.aas.{module}")
