"""Who may ask what: tokens, roles, names of hosts, origins, rates.

>>> keys = Keys({hashed("secret"): ("anna", "operate")})
>>> keys.of("secret"), keys.of("guess")
(('anna', 'operate'), None)
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import os
import secrets
import time
from collections.abc import Mapping
from pathlib import Path

from evertwin.service.site.site_spec import HttpSpec, Role

PATIENCE = 10
"""Wrong tokens of one address in a minute that are answered as such."""
KNOWN = 4096
"""Addresses that are kept in mind."""


def hashed(token: str) -> str:
    """How a token is kept: it is random and long, so one SHA-256 is enough.

    >>> len(hashed("x"))
    64
    """
    return hashlib.sha256(token.encode()).hexdigest()


def new_token() -> str:
    """256 random bits as text."""
    return secrets.token_urlsafe(32)


class Keys:
    """Users by the hash of their token. See the module for an example."""

    def __init__(self, users: Mapping[str, tuple[str, Role]]) -> None:
        self._users = users

    @classmethod
    def of_site(cls, http: HttpSpec, file: Path) -> Keys:
        """The users of the settings; without any, whoever knows the token in a file: it is made
        where it is not there, readable by its owner alone."""
        if http.user:
            return cls({user.hash: (user.name, user.role) for user in http.user})
        if not file.exists():
            handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "w", encoding="ascii") as paper:
                paper.write(new_token() + "\n")
        return cls({hashed(file.read_text(encoding="ascii").strip()): ("token", "operate")})

    def of(self, token: str) -> tuple[str, Role] | None:
        """Name and role; every hash is compared, in constant time."""
        given, found = hashed(token), None
        for known, user in self._users.items():
            if hmac.compare_digest(given, known):
                found = user
        return found


class Pace:
    """How often an address may ask: so often for long, four times as many at once.

    >>> pace = Pace(1.0)
    >>> [pace.takes("a", now=0.0) for _ in range(5)]
    [True, True, True, True, False]
    >>> pace.takes("a", now=1.0)
    True
    """

    def __init__(self, rate: float, burst: float = 4.0) -> None:
        self._rate, self._most = rate, burst * rate
        self._left: dict[str, tuple[float, float]] = {}

    def takes(self, who: str, now: float | None = None) -> bool:
        """May it, once more?"""
        now = time.monotonic() if now is None else now
        left, then = self._left.get(who, (max(self._most, 1.0), now))
        left = min(left + (now - then) * self._rate, max(self._most, 1.0))
        if len(self._left) >= KNOWN and who not in self._left:
            self._left.pop(next(iter(self._left)))
        self._left[who] = (left - 1.0 if left >= 1.0 else left, now)
        return left >= 1.0


def host_of(text: str) -> str:
    """The name in a Host header, without its port.

    >>> host_of("[::1]:8700"), host_of("Hall.example:8700"), host_of("127.0.0.1")
    ('::1', 'hall.example', '127.0.0.1')
    """
    if text.startswith("["):
        return text[1:].partition("]")[0].lower()
    return text.partition(":")[0].lower()


def may_be_called(http: HttpSpec, host: str) -> bool:
    """Is it a name that the service has? Another one is a page that had its name rebound."""
    name = host_of(host)
    own = {"localhost", *(one.lower() for one in http.hosts)}
    try:
        address = ipaddress.ip_address(name)
        any_own = ipaddress.ip_address(http.address).is_unspecified
        return name == http.address or address.is_loopback or (any_own and not address.is_global)
    except ValueError:
        return name in own


def may_come_from(http: HttpSpec, origin: str, host: str) -> bool:
    """May a web page of this origin ask? The service's own may, and those that are listed."""
    scheme = "https" if http.certificate else "http"
    return origin in (*http.origins, f"{scheme}://{host}")
