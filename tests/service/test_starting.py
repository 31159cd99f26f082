"""A twin that starts says so: the same question may be asked a little later."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from evertwin.errors import NotYet, UsageError
from evertwin.service.http.api import CODES
from evertwin.service.twin.runner import Runner


@pytest.mark.parametrize(("state", "code"), [("starting", 503), ("quarantined", 400)])
def test_a_question_before_there_is_an_answer(state: str, code: int) -> None:
    runner: Any = SimpleNamespace(work=None, state=state, name="arm", reason="")
    with pytest.raises(UsageError, match=f"arm is {state}") as told:
        asyncio.run(Runner.ask(cast(Runner, runner), lambda work: work))
    assert isinstance(told.value, NotYet) == (code == 503)
    assert next(c for kind, c in CODES if isinstance(told.value, kind)) == code
