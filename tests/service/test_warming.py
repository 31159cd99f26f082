"""What a twin needs is machine code before it begins."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.compiled import functions
from evertwin.loop import scores
from evertwin.models.terms import kernel
from evertwin.service.plan import read_site
from evertwin.service.warming import warm
from evertwin.trial import betting, gate_loop
from planted.serving import site


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
    assert "_compiled" in kernel.step.__dict__
    assert set(asked) >= {"lag", "coupling", "law", "table", "surface", "state"}
