"""Both engines give the same answers; a pool survives the death of a process."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator, Mapping
from functools import partial

import pytest

from evertwin.engine import Engine, InProcess, Job, Pool
from evertwin.errors import ModelError, UsageError
from evertwin.fold.records import Request
from evertwin.types import Json


def work(request: Request) -> Mapping[str, Json]:
    """What a request's kind asks for."""
    if request.kind == "fails":
        raise ModelError("arm: no convergence")
    if request.kind == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if request.kind == "bug":
        raise ZeroDivisionError("a bug")
    if request.kind == "slow":
        time.sleep(0.5)
    return {"rows": request.window[1] - request.window[0], "id": request.id}


def prepare(request: Request) -> Job:
    return partial(work, request)


def request(number: int, kind: str = "fit") -> Request:
    return Request(number, kind, number % 2, 10, 20, (0, 10 * number))


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(prepare, workers=1) as engine:
        yield engine


@pytest.fixture(params=["in process", "pool"])
def engine(request: pytest.FixtureRequest, pool: Pool) -> Engine:
    return pool if request.param == "pool" else InProcess(prepare)


def test_answers_come_once_with_id_and_version(engine: Engine) -> None:
    for number in (3, 1, 2):
        engine.submit(request(number))
    found = [answer for number in (1, 2, 3) for answer in engine.answers(until=number)]
    assert [(a.id, a.version, a.content["rows"]) for a in sorted(found, key=lambda a: a.id)] == [
        (1, 1, 10),
        (2, 0, 20),
        (3, 1, 30),
    ]
    assert engine.answers() == ()


def test_an_own_error_is_an_answer(engine: Engine) -> None:
    engine.submit(request(1, "fails"))
    (answer,) = engine.answers(until=1)
    assert answer.content == {"error": "ModelError: arm: no convergence"}


def test_a_bug_passes(engine: Engine) -> None:
    engine.submit(request(1, "bug"))
    with pytest.raises(ZeroDivisionError):
        engine.answers(until=1)


def test_an_id_is_open_once(engine: Engine) -> None:
    engine.submit(request(1))
    with pytest.raises(UsageError, match="request 1: is already open"):
        engine.submit(request(1))
    engine.answers(until=1)


def test_map_keeps_the_order(engine: Engine) -> None:
    assert engine.map(abs, range(-3, 3)) == [3, 2, 1, 0, 1, 2]


def test_a_pool_does_not_wait(pool: Pool) -> None:
    pool.submit(request(1, "slow"))
    assert pool.answers() == ()
    assert len(pool.answers(until=1)) == 1


def test_a_pool_survives_the_death_of_its_process(pool: Pool) -> None:
    pool.submit(request(1, "dies"))
    (answer,) = pool.answers(until=1)
    assert str(answer.content["error"]).startswith("the process that worked on it died")
    pool.submit(request(2))
    (answer,) = pool.answers(until=2)
    assert answer.content["id"] == 2


def test_a_broken_pool_starts_anew_on_submit() -> None:
    with Pool(prepare, workers=1) as pool:
        pool.submit(request(1, "dies"))
        while not pool._open[1].future.done():
            time.sleep(0.01)
        pool.submit(request(2, "slow"))
        answers = {a.id: a.content for a in (*pool.answers(until=1), *pool.answers(until=2))}
        assert "error" in answers[1]
        assert answers[2]["rows"] == 20


def test_misuse_is_refused() -> None:
    with pytest.raises(UsageError, match="built without 'prepare'"):
        InProcess().submit(request(1))
    with pytest.raises(UsageError, match="workers: expected at least 1, got 0"):
        Pool(prepare, workers=0)


def test_closed_engines_have_no_open_work() -> None:
    engine = InProcess(prepare)
    engine.submit(request(1))
    engine.close()
    assert engine.answers() == ()
