"""Asset administration shells, written and read again by basyx-python-sdk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from basyx.aas import model
from basyx.aas.adapter import aasx
from basyx.aas.adapter.json import read_aas_json_file

from evertwin import Twin
from evertwin.errors import UsageError
from evertwin.fold import Event
from planted.serving import TWINS
from planted.worlds import record_robot


def read(path: Path) -> Any:
    """Strictly: what does not fit the metamodel is an error."""
    if path.suffix == ".json":
        return read_aas_json_file(path, failsafe=False)
    store: Any = model.DictIdentifiableStore()
    with aasx.AASXReader(str(path)) as reader:
        reader.read_into(store, aasx.DictSupplementaryFileContainer())
    return store


def at(submodel: Any, *names: str) -> Any:
    for name in names:
        submodel = submodel.get_referable(name)
    return submodel.value


@pytest.mark.parametrize("suffix", [".json", ".aasx"])
def test_a_shell_comes_back(tmp_path: Path, suffix: str) -> None:
    run, out = tmp_path / "run.csv", tmp_path / f"robot{suffix}"
    record_robot(run, "--light", "--world", "w3", "--seconds", "60", "--seed", "2")
    with Twin.open(TWINS / "robot1d.toml") as twin:
        twin.run(run)
        told = {"actions": ()}
        for kind, part in (("alarm", "wheel"), ("alarm", "motor"), ("alarm_cleared", "motor")):
            twin._ledger.say(Event(0, 0, kind, part, "wears", told))
        written = twin.export(out, "aas", data=run)
        values = dict(zip(twin.champion.names, twin.champion.values, strict=True))
    assert written.parameters == len(values) and "IDTA" in written.note
    store = read(out)
    found = {one.id_short: one for one in store if isinstance(one, model.Submodel)}
    kinds = {"Nameplate", "TechnicalData", "OperationalData", "PredictiveMaintenance"}
    assert set(found) == kinds
    (shell,) = [one for one in store if isinstance(one, model.AssetAdministrationShell)]
    assert {one.resolve(store).id_short for one in shell.submodel} == kinds
    assert at(found["Nameplate"], "Name") == "robot1d"
    for name, value in values.items():
        assert at(found["TechnicalData"], "Parameters", name.replace(".", "_"), "value") == value
    assert at(found["TechnicalData"], "Outputs", "x", "unit") == "m"
    assert at(found["OperationalData"], "Rows") > 10
    assert 0 < at(found["OperationalData"], "Residuals", "x", "rmse") < 10
    assert at(found["PredictiveMaintenance"], "Alarms", "Alarm1", "component") == "wheel"
    assert len(found["PredictiveMaintenance"].get_referable("Alarms").value) == 1


def test_other_endings_are_refused(tmp_path: Path) -> None:
    with Twin.open(TWINS / "robot1d.toml") as twin, pytest.raises(UsageError, match=r"\.aasx"):
        twin.export(tmp_path / "robot.xml", "aas")
