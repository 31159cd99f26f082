"""What an operator does to a twin: orders and labels, each an event of the log with its reason."""

from __future__ import annotations

from evertwin.errors import UsageError
from evertwin.fold import Event
from evertwin.ledger.label import Label
from evertwin.ledger.ledger import Ledger
from evertwin.refit.answers.named_cause import tunable
from evertwin.setup.setup import Setup


class ByHand:
    """The part of `Twin` that is the operator's hand. A run at work heeds what is said at its next
    beat, also one in another process (``reading``).

    >>> from evertwin.twin import Twin
    >>> issubclass(Twin, ByHand)
    True
    """

    setup: Setup
    _ledger: Ledger

    def promote(self, number: int, reason: str = "by hand", person: str = "") -> Event:
        """Makes a version live, whatever the gate says; an event tells so.

        A run at work heeds it at its next beat, also one in another process (``reading``).

        Raises:
            UsageError: there is no such version, or another one is pinned.
        """
        return self._ledger.promote(number, reason, person)

    def rollback(self, reason: str = "by hand", person: str = "") -> Event:
        """Makes the champion before the present one live again.

        Raises:
            UsageError: there was none before, or the present one is pinned.
        """
        return self._ledger.roll_back(reason, person)

    def pin(self, number: int | None, reason: str = "by hand", person: str = "") -> Event:
        """Keeps a version live until it is unpinned (None): no promotion happens.

        Raises:
            UsageError: none is pinned that could be unpinned.
        """
        if number is None and not (self._ledger.pinned or self._ledger.reading):
            raise UsageError("pin: no version is pinned")
        return self._ledger.pin(number, reason, person)

    @property
    def causes(self) -> tuple[str, ...]:
        """Causes that a label may name: those of ``[tuning.causes]`` that may be tuned."""
        editable = set(self.setup.editable)
        return tuple(n for n, numbers in self.setup.causes.items() if editable & set(numbers))

    def label(self, said: Label) -> Event:
        """Keeps what a person says to an event of the log; what acts is heeded at the next beat of
        a run at work, else by the next run (``heeded`` tells what it changed):
        ``twin.label(Label(7, "faulty", "sensor unplugged"))``, of `evertwin.ledger`.

        Raises:
            UsageError: there is no such event or cause, or nothing of the cause may be tuned.
        """
        if not isinstance(said, Label):
            raise UsageError(
                "label: expected evertwin.ledger.Label(number of the event, verdict, reason), got "
                f"{type(said).__name__}"
            )
        if said.cause:
            tunable(self.setup, said.cause)
        return self._ledger.label(said)
