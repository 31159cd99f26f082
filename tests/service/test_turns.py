"""Twins of one process take turns; what comes meanwhile is taken together."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from evertwin.service.twin import process
from evertwin.service.twin.process import PAUSE, Process, Turns
from evertwin.service.twin.queue_drain import ENOUGH, Gathering


async def taken(queue: Gathering[int], pieces: Sequence[int], pause: float) -> list[list[int]]:
    """What comes out while pieces come in, one by one."""
    found: list[list[int]] = []

    async def work() -> None:
        async for some in queue.together(lambda: pause):
            found.append(some)

    working = asyncio.create_task(work())
    for piece in pieces:
        await queue.put(piece)
        await asyncio.sleep(0.0)
    await queue.join()
    working.cancel()
    return found


def test_the_first_piece_never_waits_and_the_rest_are_gathered() -> None:
    found = asyncio.run(taken(Gathering(Turns(1)), range(8), pause=1.0))
    assert found == [[0], list(range(1, 8))]


@pytest.mark.parametrize("most", [0, 1000, 5])
def test_enough_pieces_do_not_wait(most: int) -> None:
    async def then() -> tuple[int, int]:
        queue: Gathering[int] = Gathering(Turns(1), most)

        async def fill() -> None:
            for piece in range(1 + ENOUGH):
                await queue.put(piece)

        queue.put_nowait(-1)
        found = queue.together(lambda: 3600.0)
        first = len(await anext(found))
        filling = asyncio.create_task(fill())
        then = len(await anext(found))
        filling.cancel()
        return first, then

    first, second = asyncio.run(asyncio.wait_for(then(), 60.0))
    assert first == 1 and 1 < second <= 1 + ENOUGH


def test_who_works_alone_has_what_came_meanwhile_at_once() -> None:
    async def two() -> list[list[int]]:
        turns = Turns(1)
        async with turns.one():
            waiting = asyncio.create_task(taken(Gathering(turns), range(4), pause=0.0))
            await asyncio.sleep(0.0)
            while waiting not in asyncio.all_tasks():
                await asyncio.sleep(0.0)
            for _ in range(20):
                await asyncio.sleep(0.0)
        return await waiting

    assert asyncio.run(two()) == [[0, 1, 2, 3]]


def test_a_long_turn_keeps_nobody_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "LONGEST", 0.01)

    async def beside() -> int:
        turns, count = Turns(1), 0
        async with turns.one():
            for _ in range(3):  # a turn that was taken away is not given back a second time
                async with turns.one():
                    count += 1
        async with turns.one():
            assert turns._free.locked()
        return count

    assert asyncio.run(asyncio.wait_for(beside(), 60.0)) == 3


def test_the_more_twins_the_longer_is_gathered() -> None:
    pauses = [Process(twins=[str(k) for k in range(n)]).pause() for n in (1, 10, 1000)]
    assert pauses == [pytest.approx(0.005), pytest.approx(0.05), PAUSE]
