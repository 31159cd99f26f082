"""Whether a process can go on from a store is told before anything is written."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from evertwin import Twin, TwinSpec
from evertwin.config.spec import AnomalySpec, ChannelSpec, ModelSpec, SourceSpec, StoreSpec
from evertwin.ledger.ledger import Ledger
from evertwin.ledger.versions import Versions
from evertwin.loop import loading
from evertwin.loop.loading import other_settings, unloadable
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.store import SqliteStore


@pytest.fixture
def spec(tmp_path: Path) -> TwinSpec:
    source = SourceSpec("log", {n: ChannelSpec(n, unit="1") for n in ("v", "x")})
    store = StoreSpec("twin.db")
    return TwinSpec(
        "cart", ModelSpec("robot1d"), source=(source,), store=store, folder=str(tmp_path)
    )


def looked(spec: TwinSpec) -> tuple[str, str]:
    setup = Setup(spec, model_of(spec, None))
    with closing(SqliteStore(Path(spec.folder) / "twin.db", read_only=True)) as store:
        before = store.head
        ledger = Ledger(store, Versions(setup.model), spec.name, reading=True)
        found = unloadable(setup, ledger), other_settings(setup, ledger)
        assert store.head == before
    return found


def test_what_can_be_gone_on_from(spec: TwinSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(300.0)
    with Twin(spec) as twin:
        assert looked(spec) == ("", "")  # nothing was run yet
        twin.push({"t": t, "v": 0.1 + 0.0 * t, "x": 0.1 * t})
        assert looked(spec) == ("", "")  # without a checkpoint it is folded from its first sample
        twin.going().rest()
    assert looked(spec) == ("", "")
    other = replace(spec, anomaly=AnomalySpec(requirement=0.05))
    assert looked(other)[0] == "" and "run 1 was begun with other settings" in looked(other)[1]

    class Later(NamedTuple):
        """As another version might have it."""

        rate: float
        task: int
        aligned: object
        more: float = 0.0

    monkeypatch.setattr(loading, "FeedState", Later)
    assert "field s.feed.more is missing" in looked(spec)[0]
