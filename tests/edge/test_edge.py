"""Whatever a stranger hands over ends in a result or in one clear line, at once, in bounded memory.

``python -m proofs.edge`` counts the same over ten thousand mutations.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.edge.judge import judged, planted
from tests.edge.mutations import mutated
from tests.edge.sandbox import Sandbox
from tests.edge.seeds import SEEDS
from tests.edge.texts import TEXTS

EACH = 1
# A machine under load is slow: the proof counts that.
REFUSED = ("json", "breakdown file")
"""Kinds whose valid file ends in a refusal: it holds no table; it needs recordings."""


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    with Sandbox(seconds=60.0) as helper:
        yield helper


@pytest.mark.parametrize("kind", SEEDS)
def test_the_valid_file_is_read_and_another_reader_agrees(sandbox: Sandbox, kind: str) -> None:
    seed = SEEDS[kind]()
    for command in seed.commands:
        found = planted(sandbox, kind, 0, (seed, seed.content, command))
        assert set(found.faults) <= {"slow"}, found.done
        assert found.refused is (kind in REFUSED), found.done


@pytest.mark.parametrize("kind", SEEDS)
def test_a_mutated_file_does_no_harm(sandbox: Sandbox, kind: str) -> None:
    for number in range(EACH):
        found = judged(sandbox, kind, number)
        harmful = set(found.faults) - {"slow"}
        assert not harmful, (number, found.faults, found.done)


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_ends_in_its_sentence(sandbox: Sandbox, name: str) -> None:
    seed, command, code, said = TEXTS[name]
    found = planted(sandbox, name, 0, (seed, seed.content, command))
    assert set(found.faults) <= {"slow"} and found.done.code == code, found.done
    assert said in found.done.out + found.done.err, found.done


def test_mutations_are_repeatable_and_do_something() -> None:
    for kind, make in SEEDS.items():
        seed = make()
        changed = [mutated(seed.content, binary=seed.binary, seed=(kind, k)) for k in range(40)]
        again = [mutated(seed.content, binary=seed.binary, seed=(kind, k)) for k in range(40)]
        assert changed == again
        assert sum(one != seed.content for one in changed) > 30
