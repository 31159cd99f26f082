"""The running service under attack: sockets that outlive their token or never speak, paths,
secrets; and names that a spreadsheet would run."""

from __future__ import annotations

import asyncio
import itertools
import json
import re
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
import websockets

from evertwin.service.http.access import hashed
from evertwin.signals.channels import Channel, Layout
from evertwin.signals.series import Series
from evertwin.sources.writers import write
from planted.serving import ENTRY, Served, site
from planted.worlds import record_robot

USERS = 'port = 0\nrate = 100000\ntimeout = 60.0\nconnections = 60\n' + "".join(
    f'[[http.user]]\nname = "{name}"\nrole = "operate"\nhash = "{hashed(name)}"\n'
    for name in ("anna", "ben")
)  # fmt: skip
SECRET = "s3cret-of-the-broker"
PUBLISHER = """[[twin.publisher]]
protocol = "mqtt"
port = 9
user = "twin"
password = "${HALL_PASSWORD}"
"""


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("hall")
    record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", "20", "--seed", "3")
    file = site(folder, "robot", speed=50, http=USERS)
    file.write_text(file.read_text() + PUBLISHER + ENTRY.format(name="still", speed=0.001))
    with Served(file, HALL_PASSWORD=SECRET) as served:
        yield served
    log = (folder / "log.jsonl").read_text()
    assert SECRET not in log and not re.search(r"\b(anna|ben)'s\b", log)
    assert "Traceback" not in log


def ask(served: Served, path: str, **more: object) -> tuple[int, object]:
    return served.ask(path, token="anna", **more)  # type: ignore[arg-type]


def test_paths_lead_nowhere(served: Served) -> None:
    """W4: each way up, in each writing, at each place of each route that takes a name."""
    ups = ["../", "..%2f", "%2e%2e/", "%2e%2e%2f", "..%5c", "..%252f", "....//", "..;/"]
    ends = ["etc/passwd", "site.toml", "store/token", "robot1d.toml", "log.jsonl"]
    starts = ["/api/v1/twins/", "/api/v1/twins/robot/", "/api/v1/twins/robot/samples?source="]
    corpus = [start + up * deep + end for start, up, deep, end in
              itertools.product(starts, ups, (1, 4, 9), ends)]  # fmt: skip
    folder = str(served.file.parent)
    whole = [f"{folder}/{end}" for end in ends] + ["/etc/passwd", "file:///etc/passwd", "C:\\boot"]
    wild = [*whole, "%00", "robot%00.db", "~", "con", ".", "..", "*", "a" * 4000]
    corpus += [start + quote(one, safe="%") for start, one in itertools.product(starts, wild)]
    corpus += [start + one for start, one in itertools.product(starts, whole[:5])]
    assert len(corpus) > 400
    for path in corpus:
        code, told = ask(served, path.replace("\\", "%5c"))
        assert code in (400, 404, 405, 422), (path, code)
        assert not re.search(r"root:|schema = 1|\[\[twin|Traceback", str(told)), path


def test_secrets_are_shown_nowhere(served: Served) -> None:
    """W8: neither a password nor a token in any answer; the log is read when all is over."""
    served_by = json.dumps(ask(served, "/api/v1/openapi.json")[1])
    paths = [p.replace("{name}", "robot") for p in json.loads(served_by)["paths"]]
    assert len(paths) > 10
    for path in paths:
        if path.endswith("/life"):
            continue  # it computes, and says nothing of the site
        told = str(ask(served, path)[1])
        assert SECRET not in told and hashed("anna") not in told, path
    wrong = served.file.read_text()
    served.file.write_text(wrong.replace("port = 9", 'port = "${HALL_PASSWORD}"'))
    code, told = ask(served, "/api/v1/reload", body={})
    served.file.write_text(wrong)
    assert code == 400 and "port" in str(told) and SECRET not in str(told)


def test_slow_sockets_of_one_address_do_not_keep_others_out(served: Served) -> None:
    """W6: from 127.0.0.2 more sockets than there are places, each with half a request."""
    with ExitStack() as held:
        for _ in range(80):
            line = held.enter_context(socket.socket())
            line.bind(("127.0.0.2", 0))
            line.connect(("127.0.0.1", served.port))
            line.sendall(b"GET /api/v1/status HTTP/1.1\r\nHost: localh")
        assert [ask(served, "/api/v1/status")[0] for _ in range(20)] == [200] * 20
    assert ask(served, "/api/v1/status")[0] == 200


def test_what_is_asked_before_the_first_row_has_an_answer(served: Served) -> None:
    code, told = ask(served, "/api/v1/twins/still/life")
    assert (code, "no row yet" in str(told)) in ((409, True), (400, False)), told


def test_a_socket_ends_with_its_token(served: Served) -> None:
    """W3: who is taken out of the site file is cut off; others stay."""
    text = served.file.read_text()
    ben = text.index('[[http.user]]\nname = "ben"')
    without = text[:ben] + text[text.index("[[twin]]", ben) :]

    async def both() -> tuple[int | None, int]:
        where = f"ws://127.0.0.1:{served.port}/api/v1/stream"
        heads = [{"Authorization": f"Bearer {name}"} for name in ("ben", "anna")]
        async with (
            websockets.connect(where, additional_headers=heads[0]) as cut,
            websockets.connect(where, additional_headers=heads[1]) as stays,
        ):
            served.file.write_text(without)
            assert (await asyncio.to_thread(ask, served, "/api/v1/reload", body={}))[0] == 200
            with pytest.raises(websockets.exceptions.ConnectionClosed):
                while True:
                    await asyncio.wait_for(cut.recv(), 30)
            return cut.close_code, len(await asyncio.wait_for(stays.recv(), 30))

    code, length = asyncio.run(both())
    assert code == 4401 and length > 0
    assert served.ask("/api/v1/status", token="ben")[0] == 401


def test_a_name_is_no_formula(tmp_path: Path) -> None:
    """W7: what a spreadsheet would run, or what would break the line, is text."""
    layout = Layout((Channel("=1+1", "m"), Channel("a,b", "m")))
    one = Series(layout, np.zeros(1, np.int64), np.zeros((1, 2)))
    write(tmp_path / "out.csv", {"x": one})
    assert (tmp_path / "out.csv").read_text().splitlines()[0] == 't [s],\'=1+1 [m],"a,b [m]"'
