"""A twin file that says another model than the store: what was tuned goes on, or it is said."""

from __future__ import annotations

import logging

import pytest

from evertwin.errors import UsageError
from evertwin.ledger.ledger import Ledger
from evertwin.ledger.versions import Versions
from evertwin.machines.drive import DriveForce
from evertwin.models.form import Form
from evertwin.store import SqliteStore


def tuned(store: SqliteStore, law: str = "tanh", **values: float) -> Ledger:
    ledger = Ledger(store, Versions(DriveForce(law)), "axis")
    found = ledger.keep(Form(), {"Fc": 9.0, "Fv": 30.0} | values, "found by a fit")
    ledger.promote(found.number, "by hand")
    return ledger


def live(store: SqliteStore, model: DriveForce, *, reading: bool = False) -> dict[str, float]:
    ledger = Ledger(store, Versions(model), "axis", reading=reading)
    return dict(ledger.versions.values(ledger.champion))


@pytest.mark.parametrize("reading", [True, False])
def test_what_was_tuned_goes_on_beside_numbers_that_do_not_act(reading: bool) -> None:
    store = SqliteStore(":memory:")
    tuned(store)
    for _ in range(2):  # and is not made anew the next time
        now = live(store, DriveForce("tanh+stribeck+root"), reading=reading)
        assert (now["Fc"], now["Fv"], now["Fs"]) == (9.0, 30.0, 0.0)
    if not reading:
        ledger = Ledger(store, Versions(DriveForce("tanh+stribeck+root")), "axis")
        assert len(ledger.versions) == 4
        assert ledger.versions[ledger.champion].reason == (
            "numbers of version 1, beside new ones: Fs, Fr, vs"
        )
        assert ledger.roll_back("by hand").evidence["version"] == 2
        with pytest.raises(UsageError, match="version 1 is of another model, which differs in Fr"):
            ledger.roll_back("by hand")
        with pytest.raises(UsageError, match="another model"):
            ledger.promote(1, "by hand")


def test_a_term_that_is_gone_takes_its_zero_along() -> None:
    store = SqliteStore(":memory:")
    tuned(store, "tanh+root")
    assert live(store, DriveForce("tanh"))["Fc"] == 9.0


def test_where_the_old_numbers_mean_something_else_it_is_said(
    caplog: pytest.LogCaptureFixture,
) -> None:
    store = SqliteStore(":memory:")
    tuned(store, "tanh+root", Fr=0.1)
    with caplog.at_level(logging.WARNING, "evertwin"):
        assert live(store, DriveForce("tanh"))["Fc"] != 9.0
    assert "not the one that version 1 was tuned for, so version 2 is live" in caplog.text


def test_nothing_is_said_where_nothing_was_tuned(caplog: pytest.LogCaptureFixture) -> None:
    store = SqliteStore(":memory:")
    Ledger(store, Versions(DriveForce("tanh")), "axis")
    with caplog.at_level(logging.WARNING, "evertwin"):
        ledger = Ledger(store, Versions(DriveForce("tanh+root")), "axis")
    assert (ledger.champion, caplog.text) == (1, "")
