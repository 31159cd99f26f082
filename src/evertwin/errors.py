"""Everything that can go wrong by misuse, as one tree.

A message says what was expected, what came, where, and what to do. Not converging is no error: it
is a value of the result (see `evertwin.tuning.Fit`).

    EvertwinError
    ├── UsageError            exit code 2    a call or an option that cannot be meant
    │   ├── ConfigError       exit code 2    a twin file that does not say what it must
    │   └── MissingExtra      exit code 2    an optional package is not installed
    ├── DataError             exit code 4    a recording that cannot be read or trusted
    ├── ModelError            exit code 5    a model that cannot be built or run
    │   └── WorkLost          exit code 5    work in a process of its own ended without a result
    ├── StoreError            exit code 4    a damaged or foreign store
    │   ├── NoStore           exit code 4    nothing was kept yet
    │   ├── StoreDamaged      exit code 4    bytes of a store were changed or are gone
    │   └── StoreLocked       exit code 75   the store belongs to a running process
    │       └── OwnershipLost exit code 75   another node has the twin since
    └── LawBroken             exit code 101  an implementation breaks its contract
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class EvertwinError(Exception):
    """The root of the tree.

    >>> EvertwinError("x").exit_code
    101
    """

    exit_code = 101


class UsageError(EvertwinError):
    """A call or an option that cannot be meant.

    >>> UsageError("rate: expected a number above 0 Hz, got -1").exit_code
    2
    """

    exit_code = 2


class NotYet(UsageError):
    """Asked too early: the same call can be meant a little later.

    >>> NotYet("arm is starting").exit_code
    2
    """


class ConfigError(UsageError):
    """A twin file that does not say what it must.

    >>> str(ConfigError("twin.toml:3: unknown key 'tolerence', did you mean 'tolerance'?"))
    "twin.toml:3: unknown key 'tolerence', did you mean 'tolerance'?"
    """


class MissingExtra(UsageError):
    """An optional package is not installed.

    >>> str(MissingExtra.of("pinocchio", "arm"))
    "pinocchio is not installed: pip install 'evertwin[arm]'"
    """

    @classmethod
    def of(cls, package: str, extra: str) -> MissingExtra:
        """The error for ``package``, with the command that installs it."""
        return cls(f"{package} is not installed: pip install 'evertwin[{extra}]'")


@contextmanager
def naming(
    what: str,
    caught: type[Exception] | tuple[type[Exception], ...] = UsageError,
    raised: type[Exception] = UsageError,
) -> Iterator[None]:
    """Says of an error what it is about; what is ``caught`` becomes an error that is ``raised``.

    >>> with naming("source 'log'"):
    ...     raise UsageError("expected a rate above 0 Hz, got -1")
    Traceback (most recent call last):
    evertwin.errors.UsageError: source 'log': expected a rate above 0 Hz, got -1
    """
    try:
        yield
    except caught as error:
        raise raised(f"{what}: {error}") from error


@contextmanager
def needs(extra: str, package: str = "") -> Iterator[None]:
    """Around imports of an extra: what is not installed is said by `MissingExtra`.

    >>> with needs("web", "starlette"):
    ...     import starlette_that_is_not_there
    Traceback (most recent call last):
    evertwin.errors.MissingExtra: starlette is not installed: pip install 'evertwin[web]'
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingExtra.of(package or str(error.name), extra) from error


class DataError(EvertwinError):
    """A recording that cannot be read or trusted.

    >>> DataError("run.csv:7: 'abc' is not a number").exit_code
    4
    """

    exit_code = 4


class TooFew(DataError):
    """Too few rows to judge yet; more may come.

    >>> TooFew("correction: expected at least 30 segments").exit_code
    4
    """


class TooNew(TooFew):
    """Too few rows of a machine since it changed; more will have come soon.

    >>> TooNew("the machine has changed, 40 rows ago", 960).row
    960
    """

    def __init__(self, text: str, row: int) -> None:
        super().__init__(text)
        self.row = row
        """The first of them."""


class ModelError(EvertwinError):
    """A model that cannot be built or run.

    >>> ModelError("arm.urdf: link 'wrist' has mass -1 kg, expected > 0").exit_code
    5
    """

    exit_code = 5


class WorkLost(ModelError):
    """Work in a process of its own ended without a result: too long, too large, or killed.

    >>> WorkLost("it took longer than 600 s").exit_code
    5
    """


class StoreError(EvertwinError):
    """A damaged or foreign store.

    >>> StoreError("entry 12 does not match its hash").exit_code
    4
    """

    exit_code = 4


class StoreDamaged(StoreError):
    """Bytes of a store were changed or are gone.

    >>> StoreDamaged("entry 12 does not match its hash").exit_code
    4
    """


class NoStore(StoreError):
    """Nothing was kept yet.

    >>> NoStore("arm.db: no such store").exit_code
    4
    """


class StoreUnwritable(StoreError):
    """The disk is full, or takes nothing; what was written before stands.

    >>> StoreUnwritable("arm.db: database or disk is full").exit_code
    4
    """


class StoreLocked(StoreError):
    """The store belongs to a running process.

    >>> StoreLocked("twin.db is open in process 4711").exit_code
    75
    """

    exit_code = 75


class OwnershipLost(StoreLocked):
    """Another node has the twin since; what was to be written is refused.

    >>> OwnershipLost("arm: token 3 is old, node 'south' has 4 since").exit_code
    75
    """


class LawBroken(EvertwinError):
    """An implementation breaks a named law of its contract.

    >>> str(LawBroken("partition: state differs after cut at row 3"))
    'partition: state differs after cut at row 3'
    """


def nearest(name: object, known: Iterable[str]) -> str:
    """What a message about an unknown name ends with.

    >>> nearest("gravty", ["tip", "gravity"]), nearest("x", ["tip", "gravity"]), nearest("x", [])
    ("did you mean 'gravity'?", 'there are tip, gravity', 'there are none')
    """
    names = list(known)
    near = difflib.get_close_matches(str(name), names, n=1)
    there = f"there are {', '.join(names)}" if names else "there are none"
    return f"did you mean {near[0]!r}?" if near else there


def few(told: Iterable[str], most: int = 5) -> str:
    """The first of some, and how many more there are.

    >>> few(["a", "b", "c"], 2), few([])
    ('a, b and 1 more', 'none')
    """
    names = list(told)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most]) or 'none'}{more}"


def reason_of(error: BaseException) -> str:
    """Why a line to somebody else is gone, in one line.

    >>> reason_of(TimeoutError()), reason_of(ConnectionRefusedError(111, "Connection refused"))
    ('no answer in time', 'Connection refused')
    """
    import ssl  # every command loads this file

    if isinstance(error, TimeoutError) and not str(error):
        return "no answer in time"
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"TLS: {error.verify_message}"
    if isinstance(error, ssl.SSLError):  # its number is one of OpenSSL
        return f"TLS: {(error.reason or str(error)).replace('_', ' ').lower()}"
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno) if error.errno > 0 else str(error.strerror)
    return str(error) or type(error).__name__
