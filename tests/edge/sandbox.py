"""The command line in a process of its own, under limits: `Sandbox.run` says how it ended.

A helper process imports the command line once and forks for every call, so that a call costs
milliseconds, and one that hangs, is killed or eats memory harms nothing. Processor time and memory
are the operating system's figures for that one call.
"""

from __future__ import annotations

import contextlib
import gc
import io
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

__all__ = ["Done", "Sandbox"]

MEGABYTE = 1 << 20
STOPPED = -1000
"""The code of a call that had to be stopped from outside."""


@dataclass(frozen=True)
class Done:
    """How a call of the command line ended."""

    code: int
    """Exit code; minus the signal's number if it was killed."""
    out: str
    err: str
    seconds: float
    """Processor time, without imports."""
    megabytes: float
    """Largest resident memory, imports included."""
    wrong: list[str] = field(default_factory=list)
    """Values that another reader reads otherwise."""

    @property
    def hung(self) -> bool:
        """Stopped because its time was up."""
        return self.code in (STOPPED, -signal.SIGXCPU, -signal.SIGKILL)


class Sandbox:
    """A helper that runs commands. Use it as a context manager."""

    def __init__(self, seconds: float = 10.0, megabytes: int = 1024) -> None:
        self.limits = {"seconds": seconds, "megabytes": megabytes}
        # Not measured for coverage: that would be part of each command's time and memory.
        environment = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")} | {
            "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MPLBACKEND": "agg",
            "ARROW_DEFAULT_MEMORY_POOL": "system",
            "PYTHONPATH": os.pathsep.join([*(p for p in sys.path if p), os.getcwd()]),
        }  # fmt: skip
        self.helper = subprocess.Popen(
            [sys.executable, "-m", "tests.edge.sandbox"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment,
        )  # fmt: skip

    def __enter__(self) -> Sandbox:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self.helper.stdin is not None and self.helper.stdout is not None
        self.helper.stdin.close()
        self.helper.wait()
        self.helper.stdout.close()

    def run(self, folder: Path, words: Sequence[str], reader: str = "", file: str = "") -> Done:
        """``evertwin WORDS`` in ``folder``; where it ends well, ``reader`` reads ``file`` too."""
        assert self.helper.stdin is not None and self.helper.stdout is not None
        asked = {"folder": str(folder), "words": list(words), "reader": reader, "file": file}
        self.helper.stdin.write(json.dumps(asked | self.limits) + "\n")
        self.helper.stdin.flush()
        return Done(**json.loads(self.helper.stdout.readline()))


def _call(asked: dict[str, Any], out: int, err: int) -> None:
    """The child: limits, then the command."""
    from evertwin.app.cli import main

    os.chdir(asked["folder"])
    os.dup2(out, 1)
    os.dup2(err, 2)
    cpu = int(asked["seconds"]) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu))
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    space = used + asked["megabytes"] * MEGABYTE
    resource.setrlimit(resource.RLIMIT_AS, (space, space))
    try:
        main(asked["words"])
        code = 0
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _compare(asked: dict[str, Any], out: int) -> None:
    """The child: what another reader reads otherwise, as a list."""
    from evertwin.errors import EvertwinError
    from tests.edge.readers import wrong

    os.chdir(asked["folder"])
    resource.setrlimit(resource.RLIMIT_CPU, (30, 30))
    try:
        found = wrong(asked["reader"], Path(asked["file"]))
    except EvertwinError:
        found = []
    os.write(out, json.dumps(found).encode())
    os._exit(0)


def _forked(asked: dict[str, Any], compare: bool) -> tuple[int, str, str, Any]:
    """Exit code, output, errors and what the system says that the call used."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if child == 0:
            if compare:
                _compare(asked, out.fileno())
            _call(asked, out.fileno(), err.fileno())
        watched = os.pidfd_open(child)
        ready, _, _ = select.select([watched], [], [], 6 * asked["seconds"] + 20)
        os.close(watched)
        if not ready:
            os.kill(child, signal.SIGKILL)
        _, status, used = os.wait4(child, 0)
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read(MEGABYTE).decode("utf-8", "replace"))
    code = os.waitstatus_to_exitcode(status) if ready else STOPPED
    return code, texts[0], texts[1], used


def _one(asked: dict[str, Any]) -> dict[str, Any]:
    code, out, err, used = _forked(asked, compare=False)
    found: list[str] = []
    if asked["reader"] and code in (0, 1):
        _, said, _, _ = _forked(asked, compare=True)
        found = json.loads(said) if said else ["the other reader gave no answer"]
    return {
        "code": code, "out": out, "err": err, "seconds": used.ru_utime + used.ru_stime,
        "megabytes": used.ru_maxrss / 1024, "wrong": found,
    }  # fmt: skip


def _once() -> None:
    """What each process does at its first twin file: forms of settings, the template."""
    from evertwin.app.cli import main

    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        file = Path(folder) / "a.csv"
        file.write_text("t,x,y\n" + "".join(f"{k},{k},{2 * k}\n" for k in range(100)))
        with contextlib.suppress(SystemExit):
            main(["init", str(file), "-o", f"{folder}/a.toml"])


def _serve() -> None:
    """The helper: imports once, then one line in, one line out."""
    import importlib

    for name in (
        "evertwin.app.twin.twin_commands", "evertwin.app.twin.engineer_command",
        "evertwin.app.twin.export_command", "evertwin.app.outlook.outlook_commands",
        "evertwin.app.first.init_command", "evertwin.machines.mobile.kernels",
        "evertwin.sources.robot_logs.bags", "h5py", "mcap.reader", "pandas",
        "pyarrow.parquet", "rosbags.highlevel", "scipy.io", "tomlkit", "tests.edge.readers",
    ):  # fmt: skip
        importlib.import_module(name)
    from evertwin.signals.units import compatible

    importlib.import_module("numba").njit("int64(int64)")(lambda number: number)  # its targets
    compatible("furlong", "m")  # the registry of units
    _once()
    gc.collect()
    gc.freeze()  # else a child's first collection copies all that it shares
    for line in sys.stdin:
        sys.stdout.write(json.dumps(_one(json.loads(line))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    _serve()
