"""Workers and the process that has them: they end with it, and never run its main module."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.engine.test_engine import ended, until

ROOT = Path(__file__).parent.parent.parent
PARENT = """
import sys
from functools import partial
from pathlib import Path
from evertwin.engine import Pool
from evertwin.fold.records import Request
from tests.engine import jobs

open({trace!r}, "a").write("main ran\\n")  # no `if __name__ == "__main__"` around it
pool = Pool(2)
for number in (1, 2):
    asked = Request(number, "fit", 0, 10, 20, (0, 10))
    path = Path({folder!r}) / f"pid{{number}}"
    pool.submit(asked, partial(jobs.told, path, native={native}))
{then}
"""


def parent(folder: Path, then: str, *, native: bool = False) -> subprocess.Popen[str]:
    """A program of a user, with two busy workers."""
    file = folder / "program.py"
    trace = str(folder / "trace")
    file.write_text(PARENT.format(trace=trace, folder=str(folder), native=native, then=then))
    path = os.pathsep.join([str(ROOT), *sys.path])
    return subprocess.Popen(
        [sys.executable, str(file)],
        env=os.environ | {"PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.mark.parametrize("native", [False, True], ids=["python", "native code"])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_parent_leaves_nothing(tmp_path: Path, how: int, native: bool) -> None:
    with parent(tmp_path, "import time; time.sleep(600)", native=native) as program:
        busy = [until(tmp_path / f"pid{number}") for number in (1, 2)]
        program.send_signal(how)
        program.wait(20)
    assert all(ended(process) for process in busy)


@pytest.mark.parametrize(
    ("then", "code"), [("", 0), ("sys.exit(3)", 3), ("raise ValueError('x')", 1)]
)
def test_a_parent_that_ends_does_not_wait_for_its_workers(
    tmp_path: Path, then: str, code: int
) -> None:
    waits = "import time\nwhile not all((path.parent / f'pid{n}').exists() for n in (1, 2)):\n"
    with parent(tmp_path, f"{waits}    time.sleep(.01)\n{then}") as program:
        busy = [until(tmp_path / f"pid{number}") for number in (1, 2)]
        begin = time.monotonic()
        assert program.wait(60) == code
    assert time.monotonic() - begin < 20
    assert all(ended(process) for process in busy)


def test_the_main_module_runs_once(tmp_path: Path) -> None:
    with parent(tmp_path, "print(pool.map(jobs.main_file, [0])); pool.close()") as program:
        for process in [until(tmp_path / f"pid{number}") for number in (1, 2)]:
            os.kill(process, signal.SIGKILL)
        out, _ = program.communicate(timeout=60)
    assert out.strip() == "[None]"
    assert (tmp_path / "trace").read_text() == "main ran\n"


def test_a_job_of_the_main_module_is_refused(tmp_path: Path) -> None:
    with parent(tmp_path, "def mine(x): return x\npool.map(mine, [1])") as program:
        out, _ = program.communicate(timeout=60)
    assert "is of the main module, which no worker imports: put it into a module" in out


def test_a_worker_ignores_the_folder_that_the_user_is_in(tmp_path: Path) -> None:
    (tmp_path / "signal.py").write_text("raise SystemExit('the wrong signal')")
    done = subprocess.run(
        [sys.executable, "-P", "-c", "from evertwin.engine import Pool\n"
         "with Pool(1) as pool: print(pool.map(abs, [-2]))"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "[2]\n"
