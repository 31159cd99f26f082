"""The one contract of everything that lives in the stream: ``init`` and ``step``.

The object is frozen configuration; what may change while running is state, parameters included.
``step`` *consumes* the state it gets (it may reuse the memory): who keeps it calls
`evertwin.fold.copy`. A state is a named tuple of arrays and scalars of fixed fields, types, ranks
and capacities.

Partition law: wherever the data is cut, the final state and the concatenated `Out` are equal bit
for bit. Rows may come out later than they went in, or fewer.

>>> class Counter:
...     def init(self): return 0
...     def step(self, state, block): return state + len(block.t), Out()
>>> from evertwin.fold.block import make_block
>>> Counter().step(0, make_block(t=[0, 1], u=[[0.0]] * 2, y=[[0.0]] * 2))[0]
2
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

from evertwin.fold.records import Record, Request

State = TypeVar("State")
In = TypeVar("In", contravariant=True)


class Out(NamedTuple):
    """What one step gave.

    >>> Out().records
    ()
    """

    rows: Any = None
    """Named tuple of arrays that share their first axis, or None. Concatenable over steps."""
    records: tuple[Record, ...] = ()
    """Records that became known in this step."""
    requests: tuple[Request, ...] = ()
    """Slow work that this step asks for."""


@runtime_checkable
class Online(Protocol[State, In]):
    """A stage of the stream. See the module for its law; `evertwin.fold.check_online` tests it.

    >>> hasattr(Online, "step")
    True
    """

    def init(self) -> State:
        """The state before the first row."""
        ...

    def step(self, state: State, block: In) -> tuple[State, Out]:
        """The state after the block, and what came out. Consumes ``state``."""
        ...
