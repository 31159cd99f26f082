"""Two nodes as processes on one server: twins are shared out, taken over, moved and given back."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evertwin.app.cli import main
from evertwin.config import read
from evertwin.service.site.site_plan import read_site
from evertwin.sources.live.mqtt.spec import MqttSettings
from evertwin.sources.recorded import Recorded
from evertwin.store import SharedStore, SqlOwners
from evertwin.store.postgres.database import Postgres, driver
from evertwin.twin import Twin
from planted.serving import Served, nodes
from planted.worlds import record_robot

LEASE = 3.0
"""Seconds. Longer than a busy machine keeps a node from renewing: nothing moves by itself."""
PATIENCE = 90.0
"""Seconds in which each step is done on a machine that runs other tests too."""


@pytest.fixture(scope="module")
def postgres(postgres: str) -> str:
    """A database of these tests' own: others say of their twins what no node would."""
    with closing(driver().connect(postgres, autocommit=True)) as db:
        db.execute("CREATE DATABASE hall")
    return f"{postgres.rsplit('/', 1)[0]}/hall"


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    file = tmp_path / "run.csv"
    record_robot(file, "--light", "--world", "w3", "--seconds", "100", "--seed", "2")
    return tmp_path


def status(file: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """As the command tells it."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as done:
        main(["fleet", "status", str(file), "--json"])
    assert done.value.code in (0, None)
    return dict(json.loads(capsys.readouterr().out))


def until(ask: Callable[[], Any], seconds: float = PATIENCE) -> None:
    end = time.monotonic() + seconds
    while not ask():
        assert time.monotonic() < end, "not so in time"
        time.sleep(0.2)  # asking takes as long as a command does


def owners(server: str, twins: tuple[str, ...]) -> dict[str, str]:
    with closing(Postgres(server)) as database:
        query = "SELECT twin, node FROM evertwin.owners WHERE until > "
        SqlOwners(database)  # the table is there, even if no node has started yet
        found = dict(database.query(query + database.now))
    return {one: found[one] for one in twins if one in found}


@pytest.mark.slow
def test_twins_go_on_elsewhere(
    hall: Path, postgres: str, capsys: pytest.CaptureFixture[str]
) -> None:
    twins = ("fleet-a", "fleet-b")
    files = nodes(hall, postgres, ("north", "south"), twins, lease=LEASE, speed=20.0)
    with Served(files["north"]) as north:
        until(lambda: len(owners(postgres, twins)) == 2)
        with Served(files["south"]) as south:
            until(lambda: len(status(files["south"], capsys)["nodes"]) == 2)
            assert set(owners(postgres, twins).values()) == {"north"}  # nothing moves by itself
            main_in(["fleet", "move", str(files["north"]), "fleet-a", "south"])
            until(lambda: owners(postgres, twins).get("fleet-a") == "south")
            south.until(lambda told: any(one["rows"] > 20 for one in told["twins"]), PATIENCE)
            told = south.ask("/api/v1/fleet")[1]
            assert told["node"] == "south" and len(told["nodes"]) == 2
            one = next(one for one in told["twins"] if one["twin"] == "fleet-b")
            assert one["node"] == "north" and one["age"] < LEASE and one["token"] == 1
            os.kill(north.process.pid, signal.SIGSTOP)
            until(lambda: owners(postgres, twins).get("fleet-b") == "south")
            os.kill(north.process.pid, signal.SIGCONT)
            north.until(lambda told: not told["twins"], PATIENCE)  # it gave up what is another's
            main_in(["fleet", "drain", str(files["north"]), "south"])
            until(lambda: set(owners(postgres, twins).values()) == {"north"})
            south.kill()
        north.until(
            lambda told: len(told["twins"]) == 2
            and all(one["state"] == "ended" for one in told["twins"]), PATIENCE,
        )  # fmt: skip
        assert north.end() == 0
    spec = read(files["north"].parent / "robot1d.toml")
    chunks = list(Recorded.of(spec.source[0], (hall / "run.csv",)).read())
    sent = np.concatenate([chunk.t for chunk in chunks])
    for twin in twins:
        with closing(SharedStore(postgres, twin, read_only=True)) as store:
            kept = np.concatenate([chunk.t for _, chunk in store.read_chunks()])
            assert kept.tolist() == sent.tolist()  # each once, in order
            said = [e.kind for e in store.read("event")]
        with closing(Postgres(postgres)) as database:
            query = "SELECT token FROM evertwin.samples WHERE twin = ? ORDER BY number"
            tokens = [token for (token,) in database.query(query, (twin,))]
            query = "SELECT token FROM evertwin.owners WHERE twin = ?"
            ((newest,),) = database.query(query, (twin,))
        assert tokens == sorted(tokens) and newest >= 3  # taken over, and given back
        with Twin(spec) as alone:
            for chunk in chunks:
                alone.push(chunk)
            assert said == [e.kind for e in alone.events]


@pytest.mark.slow
def test_a_twin_moves_only_to_a_node_that_can_go_on_with_it(
    hall: Path, postgres: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """South lacks a plug-in: it neither takes the twin nor is it given it, until that is mended."""
    twin = ("fleet-p",)
    files = nodes(hall, postgres, ("n1", "s1"), twin, lease=LEASE, speed=20.0)
    file = files["s1"].parent / "robot1d.toml"
    good = file.read_text()
    file.write_text(good.replace('kind = "robot1d"', 'kind = "pump"'))

    def told() -> dict[str, Any]:
        every = status(files["s1"], capsys)["twins"]
        return dict(next(one for one in every if one["twin"] == "fleet-p"))

    with Served(files["s1"]) as south:
        # it waits, and its node says why as soon as it has looked
        until(lambda: re.match("s1 cannot: .*pump", told()["reason"]))
        assert told()["state"] == "waits"
        with Served(files["n1"]) as north:
            until(lambda: owners(postgres, twin).get("fleet-p") == "n1")
            north.until(lambda now: any(one["rows"] > 10 for one in now["twins"]), PATIENCE)
            main_in(["fleet", "drain", str(files["n1"]), "n1"])
            until(lambda: "stays while n1 runs: s1 cannot: " in told()["reason"])
            with pytest.raises(SystemExit):
                main(["fleet", "move", str(files["n1"]), "fleet-p", "s1"])
            assert "s1 cannot go on with fleet-p: " in capsys.readouterr().err
            assert told()["node"] == "n1" and told()["state"] == "owned"
            file.write_text(good)
            assert south.ask("/api/v1/reload", {})[0] == 200
            until(lambda: owners(postgres, twin).get("fleet-p") == "s1")
            south.until(lambda now: any(one["rows"] > 20 for one in now["twins"]), PATIENCE)
            assert told()["reason"] == ""
            assert north.end() == 0
        assert south.end() == 0
    with closing(SharedStore(postgres, "fleet-p", read_only=True)) as store:
        kinds = [e.kind for e in store.read("event")]
        assert kinds.count("configured") == 1 and "late" not in kinds


def main_in(words: list[str]) -> None:
    with pytest.raises(SystemExit) as done:
        main(words)
    assert done.value.code in (0, None)


def test_what_cannot_be_meant_is_told(
    hall: Path, postgres: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = nodes(hall, postgres, ("west",), ("fleet-c",), lease=LEASE)["west"]
    for words, said in (
        (["move", str(file), "nobody", "any"], "no twin 'nobody'"),
        (["move", str(file), "nobody", "nowhere"], "no node 'nowhere'"),
        (["drain", str(file), "nowhere"], "no node 'nowhere'"),
    ):
        with pytest.raises(SystemExit) as done:
            main(["fleet", *words])
        assert done.value.code == 2 and said in capsys.readouterr().err
    text = file.read_text()
    file.write_text(text.replace("workers = 0", "workers = 0\ndays = 3"))
    with pytest.raises(SystemExit):
        main(["fleet", "status", str(file)])
    assert "one partition a day" in capsys.readouterr().err
    file.write_text(text.replace(f'store = "{postgres}"', ""))
    with pytest.raises(SystemExit):
        main(["fleet", "status", str(file)])
    assert "expected a server that the nodes share" in capsys.readouterr().err


def test_a_session_at_a_broker_goes_with_the_twin(hall: Path) -> None:
    file = nodes(hall, "postgresql://e@127.0.0.1/x", ("east",), ("fleet-d",), lease=LEASE)["east"]
    mqtt = 'protocol = "mqtt"\ntopic = "hall"\n'
    text = re.sub(r'protocol = "replay"\nfiles.*\nspeed.*\n', mqtt, file.read_text())
    for written, client in ((text, "evertwin-fleet-d-log"), (text + 'client = "own"\n', "own")):
        file.write_text(written)
        ((source,),) = [plan.sources for plan in read_site(file).twins]
        assert isinstance(source, MqttSettings) and source.client == client
    file.write_text(re.sub(r"\[fleet\]\n(.+\n){3}", "", text))
    ((source,),) = [plan.sources for plan in read_site(file).twins]
    assert isinstance(source, MqttSettings) and source.client == ""
