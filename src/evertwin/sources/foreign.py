"""Where other people's readers are called: whatever they stumble over becomes one sentence.

A reader of NumPy, SciPy, HDF5, Arrow or ROS that is given damaged bytes raises what its innards
stumble over: a `KeyError`, a tokenizer's error, a `MemoryError`. Here, and nowhere else in
`evertwin.sources`, any of them is caught.

>>> with foreign("run.npy"):
...     raise KeyError("descr")
Traceback (most recent call last):
evertwin.sources.foreign.Damaged: run.npy: damaged or cut off (KeyError: 'descr'): copy or ...

Those of the extra ``formats`` are imported with the file that needs them.

>>> load("json").__name__
'json'
"""

from __future__ import annotations

import importlib
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

from evertwin.errors import DataError, EvertwinError, MissingExtra

T = TypeVar("T")
MANY = 32
"""Items that are taken at once."""
LONGEST = 160
"""Signs of a foreign message that are kept."""
_PLACE = re.compile(r" at 0x[0-9a-f]+")
"""Where an object lay in memory, which differs from call to call."""


class Damaged(DataError):
    """A file that its reader could not read.

    >>> Damaged("run.bag", EOFError("half a record")).reason
    'EOFError: half a record'
    """

    def __init__(self, name: str, error: Exception) -> None:
        text = " ".join(_PLACE.sub("", f"{type(error).__name__}: {error}").split())
        text = text.removesuffix(":")
        self.reason = text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
        """What the reader said, in one line."""
        super().__init__(
            f"{name}: damaged or cut off ({self.reason}): copy or record the file again"
        )


@contextmanager
def foreign(name: str) -> Iterator[None]:
    """Turns what a foreign reader raises into `Damaged`; its warnings go unheard.

    Args:
        name: what is read, as it stands in a message.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except EvertwinError:
        raise
    except Exception as error:  # noqa: BLE001  no reader says all that it may raise
        raise Damaged(name, error) from None


def each(name: str, items: Iterator[T]) -> Iterator[T]:
    """The items of a foreign iterator; what it raises becomes `Damaged`.

    >>> list(each("run.bag", iter([1, 2])))
    [1, 2]
    """
    more = True
    while more:
        batch, failed = list[T](), None
        try:
            with foreign(name):
                for item in islice(items, MANY):
                    batch.append(item)  # what came before a failure is kept
        except EvertwinError as error:
            failed = error
        yield from batch
        if failed is not None:
            raise failed
        more = len(batch) == MANY


def load(module: str, extra: str = "formats") -> Any:
    """The module, or one line that says what to install.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is not None and module.split(".")[0] != error.name.split(".")[0]:
            raise
        raise MissingExtra.of(module.split(".")[0], extra) from None
