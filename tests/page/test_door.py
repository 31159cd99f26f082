"""The page's door: names, origins, who may order; the service's silence is told."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest

from evertwin.errors import UsageError
from evertwin.page.door import COOKIE, POLICY, Door
from evertwin.page.relay import Relay
from evertwin.page.server import Machines, create_page

NOBODY = "http://127.0.0.1:9"
"""Port 9 of loopback: nobody listens."""


class Browser:
    """Asks the application, without a socket."""

    def __init__(self, app: Any) -> None:
        self.app, self.cookies = app, httpx.Cookies()

    def ask(self, method: str, path: str, **more: Any) -> httpx.Response:
        async def asked() -> httpx.Response:
            way = httpx.ASGITransport(self.app)
            async with httpx.AsyncClient(
                transport=way, base_url="http://127.0.0.1", cookies=self.cookies
            ) as client:
                return await client.request(method, path, **more)

        return asyncio.run(asked())

    def get(self, path: str, **more: Any) -> httpx.Response:
        return self.ask("GET", path, **more)

    def post(self, path: str, **more: Any) -> httpx.Response:
        return self.ask("POST", path, **more)


def told(where: str, line: str) -> str:
    if line == "no":
        raise UsageError("expected orders")
    return f"{where}: {line}"


@pytest.fixture
def door() -> Door:
    return Door("secret", ("hall.example",))


@pytest.fixture
def page(door: Door) -> Browser:
    app = create_page(Relay(NOBODY, "secret"), door, Machines({"arm": "127.0.0.1:1"}, told))
    return Browser(door.guarded(app))


def test_every_answer_forbids_what_is_not_ours(page: Browser) -> None:
    for path in ("/", "/static/main.js", "/page", "/static/nothing.js"):
        headers = page.get(path).headers
        assert headers["content-security-policy"] == POLICY
        assert headers["x-content-type-options"] == "nosniff"
    assert "unsafe" not in POLICY and "http" not in POLICY
    assert "<script" in page.get("/").text and "onclick" not in page.get("/").text


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200), ({"host": "hall.example"}, 200), ({"host": "evil.example"}, 403),
        ({"host": "[::1]:8701"}, 200), ({"host": "[bad"}, 403), ({"host": ""}, 403),
        ({"origin": "http://127.0.0.1"}, 200), ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
    ],
)  # fmt: skip
def test_names_and_origins_of_others_are_refused(
    page: Browser, headers: dict[str, str], status: int
) -> None:
    assert page.get("/page", headers=headers).status_code == status


def test_who_came_by_the_link_may_order(page: Browser, door: Door) -> None:
    order: Any = {"json": {"orders": "payload=2"}}
    assert page.get("/page").json() == {"machines": ["arm"], "may_order": False}
    assert page.post("/machines/arm", **order).status_code == 401
    assert page.get("/enter?key=guess").status_code == 403
    entered = page.get(f"/enter?key={door.key}")
    assert entered.status_code == 303
    cookie = entered.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie and "secret" not in cookie
    page.cookies.set(COOKIE, door.key)
    assert page.get("/page").json()["may_order"]
    assert page.post("/machines/arm", **order).json() == {"answer": "127.0.0.1:1: payload=2"}
    assert page.get("/machines/arm").json() == {"answer": "127.0.0.1:1: ?"}
    assert page.post("/machines/arm", json={"orders": "no"}).status_code == 400
    assert page.post("/machines/robot", **order).status_code == 404
    page.cookies.set(COOKIE, "guess")
    assert page.post("/machines/arm", **order).status_code == 401


def test_a_service_that_is_not_there_is_said(page: Browser) -> None:
    answer = page.get("/api/v1/status")
    assert answer.status_code == 503 and "does not answer" in answer.json()["error"]
    assert page.post("/api/v1/twins/a/whatif", json={}).status_code == 503  # a question, no order
    assert page.get("/etc/passwd").status_code == 404
    assert page.get("/static/../door.py").status_code == 404


def test_the_key_follows_from_the_token() -> None:
    assert Door("a").key == Door("a").key != Door("b").key
