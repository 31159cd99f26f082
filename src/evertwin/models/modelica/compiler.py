"""A Modelica file through the rumoca compiler, in a process with limits of time and memory.

The compiler parses, checks, joins the components and gives the flat equations; everything after
that (solving them for the derivatives, stepping) is done here, since its own simulation takes no
inputs from outside.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from evertwin.errors import MissingExtra, ModelError, UsageError

MEMORY = 4 << 30
"""Largest memory of the compiler's process [bytes]."""
WORKER = Path(__file__).with_name("worker.py")
_PLACE = re.compile(r"\[([^\[\]\n]+?):(\d+):(\d+)\]")
_SPAN = re.compile(r"start: BytePos\((\d+)\)")
_QUOTED = re.compile(r"'([^'\n]+)'")


class Limits(NamedTuple):
    """What the compiler may take.

    >>> Limits().seconds
    60.0
    """

    seconds: float = 60.0
    memory: int = MEMORY


def equations(
    file: Path, model: str | None, roots: Sequence[str] = (), limits: Limits | None = None
) -> dict[str, Any]:
    """The flat equations of ``model`` in ``file``, as the compiler writes them.

    Args:
        file: the ``.mo`` file.
        model: name of the model, with dots inside packages; None: the only one of the file.
        roots: folders with libraries that the file uses.
        limits: of time and memory.

    Raises:
        UsageError: there is no such file.
        MissingExtra: rumoca is not installed.
        ModelError: the compiler refuses the model, runs out of its limits, or ends without a word.
    """
    if not file.is_file():
        raise UsageError(f"{file}: expected a Modelica file (.mo), there is none")
    found = _asked(file, model, roots, limits or Limits())
    if "missing" in found:
        raise MissingExtra.of(str(found["missing"]), "modelica")
    if "refused" in found:
        raise ModelError(_told(file, str(found["refused"]), found["diagnostics"]))
    return found


def _asked(file: Path, model: str | None, roots: Sequence[str], limits: Limits) -> dict[str, Any]:
    order = {"file": str(file), "model": model, "roots": list(roots), "memory": limits.memory}
    try:
        done = subprocess.run(
            [sys.executable, "-I", str(WORKER)], input=json.dumps(order), capture_output=True,
            text=True, timeout=limits.seconds, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise ModelError(
            f"{file}:1: the compiler took longer than {limits.seconds:g} s and was ended: simplify "
            "the model, or allow more (limit)"
        ) from error
    if done.returncode or not done.stdout:
        # the compiler ends on some models by itself; its last line says where
        said = done.stderr.strip().splitlines() or ["it said nothing"]
        told = _told(file, said[-1], ())
        raise ModelError(f"{told} (the compiler ended with code {done.returncode}): simplify this")
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def _told(file: Path, said: str, diagnostics: Sequence[str]) -> str:
    """What the compiler says, with file and line where they can be told."""
    lines = said.splitlines() or ["no reason given"]
    reason = lines[0].split(" could not be compiled: ")[-1].strip()
    for text in diagnostics:
        place = _PLACE.search(text)
        if place:
            head = next((one for one in text.splitlines() if one.strip().startswith("×")), reason)
            return f"{place[1]}:{place[2]}: {head.strip(' ×')}"
    line = 1
    source = file.read_bytes()
    span = _SPAN.search(said)
    if span:
        line = source[: int(span[1])].count(b"\n") + 1
        detail = re.search(r'detail: "([^"]*)"', said)
        reason = detail[1] if detail else reason
    else:
        line = _line_of(source.decode(errors="replace"), reason)
    return f"{file}:{line}: {reason}"


def _line_of(source: str, reason: str) -> int:
    """The line where what the message quotes stands first."""
    for name in _QUOTED.findall(reason):
        found = re.search(rf"\b{re.escape(name)}\b", source)
        if found:
            return source[: found.start()].count("\n") + 1
    return 1
