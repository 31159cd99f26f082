"""Who may ask what: every route by every role, hosts, origins, sizes, sockets."""

from __future__ import annotations

import asyncio
import json
import socket
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import websockets
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from evertwin.errors import ConfigError
from evertwin.service.http.access import hashed
from evertwin.service.site.site_plan import read_site
from planted.serving import Served, site
from planted.worlds import record_robot

USERS = """port = 0
rate = 5000
timeout = 1.5
origins = ["https://panel.example"]
[[http.user]]
name = "anna"
role = "operate"
hash = "{anna}"
[[http.user]]
name = "ben"
hash = "{ben}"
"""
CANARY = "canary-4711"
OPEN = {"/-/healthy", "/-/ready"}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("hall")
    record_robot(folder / "run.csv", "--light", "--world", "w3", "--seconds", "20", "--seed", "3")
    http = USERS.format(anna=hashed(CANARY), ben=hashed("ben's"))
    file = site(folder, "robot", speed=1000, http=http)
    with Served(file) as served:
        end = time.monotonic() + 30
        while served.ask("/api/v1/status", token=CANARY)[1]["twins"][0]["state"] != "ended":
            assert time.monotonic() < end
            time.sleep(0.05)
        yield served
    log = (folder / "log.jsonl").read_text()
    assert CANARY not in log and "ben's" not in log


def routes(served: Served) -> list[tuple[str, str]]:
    told = served.ask("/api/v1/openapi.json", token=CANARY)[1]
    found = [(path, method) for path, one in told["paths"].items() for method in one]
    assert len(found) > 10
    return [*found, ("/api/v1/openapi.json", "get"), ("/no/such/route", "get")]


def test_no_route_without_a_token_and_no_order_for_a_reader(served: Served) -> None:
    for path, method in routes(served):
        body = {} if method == "post" else None
        path = path.replace("{name}", "robot")
        if path.endswith("reload"):
            continue  # below: it would be heeded
        for token in ("", "wrong") if path == "/metrics" else ("",):
            assert served.ask(path, body, token)[0] == (200 if path in OPEN else 401), path
        code = served.ask(path, body, "ben's")[0]
        orders = method == "post" and not path.endswith(("whatif", "forecast"))
        assert (code == 403) == orders, (path, code)
        assert served.ask(path, body, CANARY)[0] not in (401, 403)
    assert served.ask("/api/v1/reload", {}, "ben's")[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "", "127.0.0.1.evil.example", "0x7f.1"])
def test_a_rebound_name_is_refused(served: Served, host: str) -> None:
    assert served.ask("/api/v1/status", None, CANARY, Host=host)[0] in (400, 421)


@pytest.mark.parametrize(
    ("origin", "code"),
    [("https://evil.example", 403), ("null", 403), ("https://panel.example", 200),
     ("https://panel.example.evil.example", 403), ("http://127.0.0.1:1", 403)],
)  # fmt: skip
def test_pages_of_others_may_not_ask(served: Served, origin: str, code: int) -> None:
    assert served.ask("/api/v1/status", None, CANARY, Origin=origin)[0] == code


@pytest.mark.parametrize(
    ("path", "body", "codes"),
    [
        ("/api/v1/twins/robot/whatif", b"x" * 70_000, {413}),
        ("/api/v1/twins/robot/whatif", b"[" * 60_000, {400, 422}),
        ("/api/v1/twins/robot/whatif", b'{"a":' * 5_000 + b"1" + b"}" * 5_000, {400, 422}),
        ("/api/v1/twins/robot/whatif", {"path": {"file": "/etc/passwd"}}, {400}),
        ("/api/v1/twins/robot/whatif", {"docking": {"machine": "/etc/passwd"}}, {400}),
        ("/api/v1/twins/robot/forecast", {"horizon": 1e300}, {400}),
        ("/api/v1/twins/robot/forecast", b'{"horizon": NaN}', {400, 422}),
        ("/api/v1/look", {"protocol": "modbus", "host": "169.254.169.254", "port": 502}, {400}),
        ("/api/v1/look", {"protocol": "opcua", "url": "opc.tcp://[fe80::1]:4840"}, {400}),
        ("/api/v1/twins/robot/orders", {"order": "format"}, {422}),
        ("/api/v1/twins/robot/orders", {"order": "pin", "version": 7, "reason": "x"}, {400}),
        ("/api/v1/twins/robot/orders", {"order": "pin", "reason": "x"}, {422}),
        ("/api/v1/twins/robot/rows?last=100000000", None, {422}),
        ("/api/v1/twins/robot/samples?source=log&first=nan", None, {422}),
        ("/api/v1/twins/robot/samples?source=..%2f..%2fetc", None, {404}),
        ("/api/v1/twins/..%2f..%2f..%2fetc%2fpasswd", None, {404}),
        ("/api/v1/twins/%00", None, {404}),
        ("/api/v1/twins/robot/../../../../etc/passwd", None, {404}),
    ],
)  # fmt: skip
def test_what_is_too_large_or_means_files_is_refused(
    served: Served, path: str, body: object, codes: set[int]
) -> None:
    code, told = served.ask(path, body, CANARY)
    assert code in codes, told
    assert "root:" not in str(told) and "Traceback" not in str(told)


def test_a_body_that_says_it_is_huge_or_never_comes(served: Served) -> None:
    head = f"POST /api/v1/reload HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {CANARY}\r\n"
    for more, answer in (
        ("Content-Length: 10000000000\r\n\r\n", b"413"),
        ("Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\n", b"415"),
        ("Content-Length: 10\r\n\r\nabc", b"408"),
    ):
        with socket.create_connection(("127.0.0.1", served.port), timeout=10) as line:
            line.sendall((head + more).encode())
            assert answer in line.recv(200).split(b"\r\n")[0]
    with socket.create_connection(("127.0.0.1", served.port), timeout=10) as line:
        line.sendall(b"GET / HT")  # and never more
        began = time.monotonic()
        assert line.recv(200) == b"" and time.monotonic() - began < 5


def test_answers_are_strict_json_and_safe_to_show(served: Served) -> None:
    """`Served.ask` refuses NaN."""
    for path in ("rows", "events", "samples?source=log", ""):
        code, _ = served.ask(f"/api/v1/twins/robot/{path}".rstrip("/"), None, CANARY)
        assert code == 200
    code, _ = served.ask("/api/v1/twins/<script>alert(1)</script>", None, CANARY)
    assert code == 404


def test_orders_are_in_the_log_with_person_and_reason(served: Served) -> None:
    order = {"order": "pin", "version": 0, "reason": "to see", "person": "eve"}
    assert served.ask("/api/v1/twins/robot/orders", order, CANARY)[0] == 200
    events = served.ask("/api/v1/twins/robot/events", None, CANARY)[1]["events"]
    assert events[-1]["kind"] == "pinned" and "to see" in events[-1]["reason"]
    rows = served.ask("/api/v1/twins/robot/rows?last=1", None, CANARY)[1]
    assert 0 < events[-1]["time"] <= rows["t"][-1]  # of the machine's clock
    assert events[-1]["evidence"]["person"] == "anna"  # whose token it is, whatever else is said
    unpin = {"order": "unpin", "reason": "seen"}
    assert served.ask("/api/v1/twins/robot/orders", unpin, CANARY)[0] == 200
    assert served.ask("/api/v1/twins/robot", None, CANARY)[1]["pinned"] in (True, False)


def test_questions_are_answered_from_the_newest_rows(served: Served) -> None:
    code, told = served.ask("/api/v1/twins/robot/forecast", {"horizon": 5}, "ben's")
    assert code == 200 and told["schema"] == "evertwin.forecast/1", told
    code, told = served.ask("/api/v1/twins/robot/whatif", {"speed": {"factor": 1.5}}, "ben's")
    assert code == 200 and told["schema"] == "evertwin.whatif/1", told


def socket_of(served: Served, path: str = "", **more: Any) -> Any:
    return websockets.connect(f"ws://127.0.0.1:{served.port}/api/v1/stream{path}", **more)


def bearer(token: str) -> dict[str, Any]:
    return {"additional_headers": {"Authorization": f"Bearer {token}"}}


async def first_events(served: Served, path: str, **more: Any) -> Any:
    async with socket_of(served, path, **more) as line:
        assert json.loads(await line.recv())["type"] == "alive"
        return json.loads(await asyncio.wait_for(line.recv(), 5))


def test_the_socket_has_a_cursor_and_the_same_gates(served: Served) -> None:
    whole = asyncio.run(first_events(served, "?twin=robot&after=robot:0", **bearer("ben's")))
    numbers = [event["number"] for event in whole["events"]]
    assert whole["type"] == "events" and numbers == sorted(set(numbers)) and len(numbers) > 1
    half = f"?twin=robot&after=robot:{numbers[0]}"
    as_page: Any = {"subprotocols": ["bearer.ben's"], "origin": "https://panel.example"}
    rest = asyncio.run(first_events(served, half, **as_page))
    assert [event["number"] for event in rest["events"]] == numbers[1:]
    refused: list[Any] = [
        {}, bearer("wrong"), {**bearer(CANARY), "origin": "https://evil.example"},
        {**bearer(CANARY), "origin": "null"},
    ]  # fmt: skip
    for more in refused:
        with pytest.raises(websockets.exceptions.InvalidStatus, match="403"):
            asyncio.run(first_events(served, "", **more))
    for path in ("?twin=absent", "?after=robot"):
        with pytest.raises(websockets.exceptions.InvalidStatus, match="403"):
            asyncio.run(first_events(served, path, **bearer(CANARY)))


def test_who_guesses_tokens_is_no_longer_answered(served: Served) -> None:
    codes = [served.ask("/api/v1/status", None, f"guess {k}")[0] for k in range(15)]
    assert codes[0] == 401 and codes[-1] == 429
    assert served.ask("/api/v1/status", token="ben's")[0] == 200  # who knows one still is


def certified(folder: Path) -> None:
    """A certificate that signs itself, for localhost."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "localhost")])
    now = datetime.now(UTC)
    made = (
        x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
        .serial_number(1).not_valid_before(now - timedelta(1)).not_valid_after(now + timedelta(1))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        .sign(key, hashes.SHA256())
    )  # fmt: skip
    (folder / "hall.pem").write_bytes(made.public_bytes(serialization.Encoding.PEM))
    plain, none = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    (folder / "hall.key").write_bytes(key.private_bytes(serialization.Encoding.PEM, plain, none))


def test_tls_is_spoken_and_nothing_else(tmp_path: Path) -> None:
    certified(tmp_path)
    http = 'address = "0.0.0.0"\ncertificate = "hall.pem"\nkey = "hall.key"\n'
    file = site(tmp_path, http=http + USERS.format(anna=hashed(CANARY), ben=hashed("ben's")))
    trusted = ssl.create_default_context(cafile=str(tmp_path / "hall.pem"))
    with Served(file) as served:
        assert served.address.startswith("https://")
        url = f"https://localhost:{served.port}/api/v1/status"
        asked = urllib.request.Request(url, headers={"Authorization": f"Bearer {CANARY}"})
        with urllib.request.urlopen(asked, timeout=10, context=trusted) as answer:
            assert json.load(answer)["site"] == "hall"
        with pytest.raises(urllib.error.URLError, match="CERTIFICATE_VERIFY_FAILED"):
            urllib.request.urlopen(asked, timeout=10)
        with socket.create_connection(("127.0.0.1", served.port), timeout=10) as line:
            line.sendall(b"GET /-/healthy HTTP/1.1\r\nHost: localhost\r\n\r\n")
            assert not line.recv(200).startswith(b"HTTP/1.1 200")
    assert not (tmp_path / "store" / "token").exists()


@pytest.mark.parametrize(
    ("http", "said"),
    [
        ('address = "0.0.0.0"', "expected certificate, key and at least one"),
        ('address = "::"\ncertificate = "a"\nkey = "b"', "at least one [[http.user]]"),
        ('address = "hall.example"', "expected an IP address"),
        ('certificate = "a"', "both certificate and key"),
        ('[[http.user]]\nname = "x"\nhash = "plain"', "64 digits"),
    ],
)
def test_beyond_this_machine_only_with_tls_and_users(tmp_path: Path, http: str, said: str) -> None:
    with pytest.raises(ConfigError, match=r"site\.toml:\d") as error:
        read_site(site(tmp_path, "robot", http=http))
    assert said in str(error.value)
