"""What a twin needs is machine code before it begins."""

from __future__ import annotations

import asyncio
import dataclasses
from pathlib import Path

import pytest

from evertwin.compiled import functions
from evertwin.features.scans import correlation, registration, surface
from evertwin.models.terms import kernel
from evertwin.service import service as serving
from evertwin.service.site.site_plan import read_site
from evertwin.service.twin import warming
from evertwin.service.twin.warming import Beside, warm
from evertwin.setup import scores
from evertwin.trial import betting, gate_loop
from planted.serving import site
from planted.twins import shipped


@pytest.fixture
def as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the test changes for the process is undone."""
    for name in ("BRIEF", "READ", "PER_BYTE"):
        monkeypatch.setattr(functions, name, getattr(functions, name))


@pytest.mark.usefixtures("as_before")
def test_neither_rows_nor_a_first_correction_wait_for_a_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Corrections, trials and a lost hold come late: their first call was a stall of seconds."""
    late = (gate_loop.run, betting.evidence, scores.exceeds)
    for one in late:
        monkeypatch.setattr(one, "_ready", None)
        monkeypatch.setattr(one, "_patience", 0.0)  # as if no test had called it
    asked: list[str] = []
    monkeypatch.setattr(kernel, "_compiled", lambda *it: asked.append(it[0]) or kernel.step)
    spec = read_site(site(tmp_path, "one")).twins[0].spec
    assert spec is not None
    warm(spec)
    assert all(one._ready is not None for one in late)
    assert kernel.step.__dict__["_address"]
    assert set(asked) >= {"lag", "coupling", "law", "table", "surface", "state"}


@pytest.mark.usefixtures("as_before")
def test_beside_it_a_twin_that_cannot_be_compiled_costs_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is in the cache once it is over is read at the first call."""
    spec = read_site(site(tmp_path, "one")).twins[0].spec
    assert spec is not None
    bad = dataclasses.replace(spec, model=dataclasses.replace(spec.model, kind="none-such"))
    told: list[tuple[str, str]] = []
    monkeypatch.setattr(warming, "warm_early", warming.setup_of)
    monkeypatch.setattr(warming, "warm", warming.setup_of)
    monkeypatch.setattr(
        warming.LOG, "warning", lambda _, name, error: told.append((name, str(error)))
    )
    functions.PER_BYTE = 1.0
    asyncio.run(Beside([bad, spec]).run())
    assert len(told) == 2
    assert all("none-such" in error for _, error in told)
    assert functions.PER_BYTE == 0.0


def test_twins_run_while_their_machine_code_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = site(tmp_path, "one", speed=0.001)
    (tmp_path / "run.csv").write_text("t,v_cmd,x\n0,0,0\n1,0,0\n")
    path.write_text(path.read_text().replace("warm = false", 'warm = "beside"'))
    seen: list[str] = []

    async def slow(beside: Beside) -> None:
        seen.append("began")
        try:
            await asyncio.sleep(3600)
        finally:
            seen.append("ended")

    def refused(_: object) -> None:
        raise AssertionError("it compiles before it is ready")

    async def life() -> list[str]:
        service = serving.Service(path)
        await service.start()
        states = [one.state for one in service.runners.values()]
        await asyncio.sleep(0)
        await service.stop()
        return states

    monkeypatch.setattr(Beside, "run", slow)
    monkeypatch.setattr(serving, "before", refused)
    assert asyncio.run(life()) == ["running"]
    assert seen == ["began", "ended"]


def test_a_twin_that_perceives_waits_for_what_reads_its_scans(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plain Python does not keep up with scans: its robot had no row for a minute."""
    spec = shipped("robot_live")
    order: list[str] = []
    beside = Beside([spec])

    class Here:
        """In the place of a pool."""

        def map(self, work: object, specs: list[object]) -> list[object]:
            order.append("made")
            return specs

        def close(self) -> None:
            pass

    monkeypatch.setattr(warming, "Pool", lambda *_: Here())
    monkeypatch.setattr(warming, "at_once", lambda: None)

    async def life() -> None:
        waiting = asyncio.create_task(asyncio.to_thread(beside.wait, spec))
        await asyncio.sleep(0.05)
        assert not waiting.done()
        await beside.run()
        await waiting

    asyncio.run(life())
    assert order == ["made"] * 3
    beside.wait(spec)


def test_scans_are_read_by_machine_code_from_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    late = (registration.register, surface.surface, correlation.bounded)
    for one in late:
        monkeypatch.setattr(one, "_ready", None)
        monkeypatch.setattr(one, "_patience", 0.0)
    for name in ("BRIEF", "READ", "PER_BYTE"):
        monkeypatch.setattr(functions, name, getattr(functions, name))
    warming.warm_scans(shipped("robot_live"))
    assert all(one._ready is not None for one in late)
