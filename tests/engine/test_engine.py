"""Both engines give the same answers; a pool outlives what happens in its processes."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from evertwin.engine import Engine, EngineSpec, InProcess, Pool
from evertwin.errors import UsageError, WorkLost
from evertwin.fold.records import Answer, Request
from tests.engine import jobs


def request(number: int, kind: str = "fit") -> Request:
    return Request(number, kind, number % 2, 10, 20, (0, 10 * number))


def submit(engine: Engine, number: int, kind: str = "fit") -> None:
    asked = request(number, kind)
    engine.submit(asked, partial(jobs.work, asked))


def answer(engine: Engine, number: int, kind: str = "fit") -> Any:
    """The content of one answer."""
    submit(engine, number, kind)
    (found,) = engine.answers(until=number)
    return found.content


def until(path: Path) -> int:
    """The process that has written its number down."""
    end = time.monotonic() + 60
    while not path.exists() or not path.read_text():
        assert time.monotonic() < end
        time.sleep(0.01)
    return int(path.read_text())


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Pool(1, EngineSpec(time=1.5, memory=0.5)) as engine:
        yield engine


@pytest.fixture(params=["in process", "pool"])
def engine(request: pytest.FixtureRequest, pool: Pool) -> Engine:
    return pool if request.param == "pool" else InProcess()


def test_pools_that_share_processes_know_their_own_requests(pool: Pool) -> None:
    one, other = pool.share(), pool.share()
    for mine in (one, other):
        submit(mine, 1)
    assert [[found.id for found in mine.answers(until=1)] for mine in (one, other)] == [[1], [1]]
    submit(other, 2)
    other.close()  # its own work ends, not the processes
    assert other.answers() == () and answer(one, 2) == answer(pool, 2)


def test_pools_that_share_processes_take_turns(pool: Pool) -> None:
    greedy, modest = pool.share(), pool.share()
    for number in (1, 2, 3, 4):
        submit(greedy, number, "slow")
    submit(modest, 1)
    assert [found.id for found in modest.answers(until=1)] == [1]
    early = greedy.answers()
    assert len(early) <= 1  # it did not wait for what was asked before it
    while len(early) < 4:
        early += greedy.answers()
    assert 2.0 <= greedy.seconds < 4.0 and modest.seconds < 0.5
    late = pool.share()  # who comes later does not catch up on what others had before
    for number in (1, 2, 3, 4):
        submit(late, number, "slow")
    submit(greedy, 5)
    assert [found.id for found in greedy.answers(until=5)] == [5]
    assert len(late.answers()) <= 2
    late.close()


def test_answers_come_once_with_id_and_version(engine: Engine) -> None:
    for number in (3, 1, 2):
        submit(engine, number)
    found: list[Answer] = []
    for number in (1, 2, 3):
        found += engine.answers(until=number)
    assert [(a.id, a.version, a.content["rows"]) for a in sorted(found, key=lambda a: a.id)] == [
        (1, 1, 10),
        (2, 0, 20),
        (3, 1, 30),
    ]
    assert engine.answers() == ()


def test_an_own_error_is_an_answer(engine: Engine) -> None:
    assert answer(engine, 1, "fails") == {"error": "ModelError: arm: no convergence"}


def test_a_bug_passes(engine: Engine) -> None:
    with pytest.raises(ZeroDivisionError, match="a bug"):
        answer(engine, 1, "bug")


def test_an_id_is_open_once(engine: Engine) -> None:
    submit(engine, 1)
    with pytest.raises(UsageError, match="request 1: is already open"):
        submit(engine, 1)
    engine.answers(until=1)


def test_what_is_dropped_has_no_answer(engine: Engine) -> None:
    submit(engine, 1)
    engine.drop(1)
    engine.drop(7)
    assert engine.answers(until=1) == ()


def test_map_keeps_the_order(engine: Engine) -> None:
    assert engine.map(abs, range(-3, 3)) == [3, 2, 1, 0, 1, 2]


# ---------------------------------------------------------------------- processes


def test_a_pool_does_not_wait(pool: Pool) -> None:
    submit(pool, 1, "slow")
    assert pool.answers() == ()
    assert len(pool.answers(until=1)) == 1


def test_a_process_is_kept_and_is_not_this_one(pool: Pool) -> None:
    found = {answer(pool, number)["process"] for number in (1, 2, 3)}
    assert len(found) == 1 and os.getpid() not in found


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("endless", "it took longer than 1.5 s"),
        ("native", "it took longer than 1.5 s"),
        ("large", "it took more than its 0.5 GB of memory"),
        ("dies", "its process died (Killed)"),
        ("leaves", "its process died (exit code 3)"),
    ],
)
def test_a_job_beyond_its_limits_costs_itself_alone(pool: Pool, kind: str, reason: str) -> None:
    assert answer(pool, 1, kind)["error"].startswith(f"WorkLost: {reason}")
    assert answer(pool, 2)["rows"] == 20


def test_work_is_dropped_while_it_runs(tmp_path: Path) -> None:
    with Pool(1) as pool:
        pool.submit(request(1), partial(jobs.told, tmp_path / "pid"))  # type: ignore[arg-type]
        busy = until(tmp_path / "pid")
        pool.drop(1)
        assert answer(pool, 2)["process"] != busy
        assert ended(busy)


def test_a_worker_killed_between_jobs_is_replaced(pool: Pool) -> None:
    idle = answer(pool, 1)["process"]
    os.kill(idle, signal.SIGKILL)
    assert ended(idle)
    assert answer(pool, 2)["rows"] == 20


def test_a_worker_killed_in_the_middle_is_an_error(tmp_path: Path) -> None:
    with Pool(1) as pool:
        pool.submit(request(1), partial(jobs.told, tmp_path / "pid"))  # type: ignore[arg-type]
        os.kill(until(tmp_path / "pid"), signal.SIGKILL)
        (found,) = pool.answers(until=1)
        assert "its process died (Killed)" in str(found.content["error"])


def test_ctrl_c_is_the_parents_to_hear(pool: Pool) -> None:
    os.kill(answer(pool, 1)["process"], signal.SIGINT)
    submit(pool, 2, "slow")
    assert pool.answers(until=2)[0].content["rows"] == 20


def test_what_a_job_prints_and_reads_disturbs_nothing(pool: Pool) -> None:
    assert pool.map(jobs.noisy, ["hello"]) == ["hello"]


def test_each_process_is_warmed_up() -> None:
    with Pool(1, warm=jobs.first) as pool:
        assert pool.map(jobs.is_warm, [0]) == ["yes"]
        assert "error" in answer(pool, 1, "dies")
        assert pool.map(jobs.is_warm, [0]) == ["yes"]


def test_a_pool_takes_no_more_processes_than_it_may() -> None:
    with Pool(2) as pool:
        for number in range(6):
            submit(pool, number, "slow")
        found: list[Answer] = []
        for number in range(6):
            found += pool.answers(until=number)
        assert len({a.content["process"] for a in found}) == 2


def test_map_says_which_way_work_was_lost(pool: Pool) -> None:
    with pytest.raises(WorkLost, match="took longer"):
        pool.map(time.sleep, [600.0, 600.0])
    assert pool.map(abs, [-1]) == [1]


def test_an_error_that_cannot_travel_is_told_in_words(pool: Pool) -> None:
    with pytest.raises(RuntimeError, match=r"jobs\.Odd: a bug at home"):
        answer(pool, 1, "odd")


def test_an_error_says_where_it_was_raised(pool: Pool) -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        answer(pool, 1, "bug")
    assert "in work" in caught.value.__notes__[0]


# ---------------------------------------------------------------------- misuse and ends


def test_misuse_is_refused() -> None:
    with pytest.raises(UsageError, match="workers: expected at least 1, got 0"):
        Pool(0)


def test_work_that_cannot_travel_is_refused(pool: Pool) -> None:
    with pytest.raises(UsageError, match="cannot travel to another process"):
        pool.map(lambda item: item, [1])


def test_closed_engines_have_no_open_work() -> None:
    for engine in (InProcess(), Pool(1)):
        submit(engine, 1)
        engine.close()
        engine.close()
        assert engine.answers() == ()
    with pytest.raises(UsageError, match="the pool is closed"):
        submit(engine, 2)


def test_closing_does_not_wait_for_work(tmp_path: Path) -> None:
    pool = Pool(1)
    for number, file in enumerate(("one", "two")):
        pool.submit(request(number), partial(jobs.told, tmp_path / file))  # type: ignore[arg-type]
    busy = until(tmp_path / "one")
    begin = time.monotonic()
    pool.close()
    assert time.monotonic() - begin < 10 and ended(busy)
    assert not (tmp_path / "two").exists()


def test_a_pool_that_nobody_holds_ends(tmp_path: Path) -> None:
    pool = Pool(1)
    pool.submit(request(1), partial(jobs.told, tmp_path / "pid"))  # type: ignore[arg-type]
    busy = until(tmp_path / "pid")
    del pool
    assert ended(busy)


def ended(process: int) -> bool:
    """Is a process gone, with all of its threads?"""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        try:
            status = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
            threads = len(os.listdir(f"/proc/{process}/task"))
        except (FileNotFoundError, ProcessLookupError):
            return True
        if status in "ZX" and threads <= 1:
            return True
        time.sleep(0.02)
    return False
