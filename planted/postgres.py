"""A PostgreSQL server of its own in a folder: for tests and proofs, ended with them.

The server refuses to run as root: there it runs as a user without rights.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

PLACES = "/usr/lib/postgresql/*/bin"
"""Where Debian keeps the server's programs, by version."""
USERS = ("postgres", "nobody")
SLOW = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <unistd.h>
static void waits(void) {
    long microseconds = 0;
    FILE *file = fopen("%s", "r");
    if (file == NULL) return;
    if (fscanf(file, "%%ld", &microseconds) == 1) usleep(microseconds);
    fclose(file);
}
int fdatasync(int f) { waits(); return ((int (*)(int)) dlsym(RTLD_NEXT, "fdatasync"))(f); }
int fsync(int f) { waits(); return ((int (*)(int)) dlsym(RTLD_NEXT, "fsync"))(f); }
"""


def programs() -> Path | None:
    """The folder of ``initdb`` and ``postgres``; None: they are not installed."""
    found = shutil.which("initdb")
    if found is not None:
        return Path(found).resolve().parent
    places = sorted(Path("/").glob(PLACES.removeprefix("/")))
    return places[-1] if places else None


class Server:
    """A server at a free port of this machine, with an empty database.

    ``address`` is what connects to it.
    """

    def __init__(self, *settings: str, slow: bool = False) -> None:
        """Starts; ``settings`` as in ``fsync=off``; ``slow``: its disk can be made slow."""
        where = programs()
        if where is None:
            raise FileNotFoundError("initdb: install Debian's package postgresql")
        self._programs = where
        self._folder = Path(tempfile.mkdtemp(prefix="pg"))
        self._user = "" if os.getuid() else self._ordinary()
        with socket.socket() as line:
            line.bind(("127.0.0.1", 0))
            self.port = int(line.getsockname()[1])
        data = str(self._folder / "data")
        self._run([str(where / "initdb"), "-D", data, "-A", "trust", "-U", "evertwin", "-E", "UTF8",
                   "--locale=C", "--no-sync", "--data-checksums"])  # fmt: skip
        self._settings = ("fsync=on", *settings)
        self._environment = {**os.environ, **self._slow()} if slow else None
        self.address = f"postgresql://evertwin@127.0.0.1:{self.port}/postgres"
        self.start()

    def _slow(self) -> dict[str, str]:
        """What has the server wait with each write to the disk as long as a file says."""
        source, library, wait = (self._folder / name for name in ("slow.c", "slow.so", "wait"))
        source.write_text(SLOW % str(wait))
        subprocess.run(["gcc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
        return {"LD_PRELOAD": str(library)}

    def wait(self, seconds: float) -> None:
        """From now on each write to the disk takes so much longer; 0: as it does."""
        wait = self._folder / "wait"
        if seconds:
            wait.write_text(f"{1e6 * seconds:.0f}")
            wait.chmod(0o644)
        else:
            wait.unlink(missing_ok=True)

    def _ordinary(self) -> str:
        user = next((one for one in USERS if self._is(one)), USERS[-1])
        shutil.chown(self._folder, user)
        return user

    @staticmethod
    def _is(user: str) -> bool:
        return subprocess.run(["id", user], capture_output=True).returncode == 0

    def _as_user(self, command: Sequence[str]) -> list[str]:
        return ["runuser", "-u", self._user, "--", *command] if self._user else list(command)

    def _run(self, command: Sequence[str]) -> None:
        done = subprocess.run(
            self._as_user(command), cwd=self._folder, capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(f"{command[0]}: {done.stderr or done.stdout}")

    def start(self) -> None:
        """Starts, and waits until it takes connections."""
        given = [part for one in self._settings for part in ("-c", one)]
        program, data = str(self._programs / "postgres"), str(self._folder / "data")
        where = ["-h", "127.0.0.1", "-p", str(self.port), "-k", str(self._folder)]
        command = [program, "-D", data, *where, *given]
        with (self._folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                self._as_user(command), cwd=self._folder, stdout=log, stderr=log,
                env=self._environment,
            )  # fmt: skip
        ready = [str(self._programs / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(self.port)]
        for _ in range(400):
            if subprocess.run(ready).returncode == 0:
                return
            time.sleep(0.02)
        raise RuntimeError(f"postgres: {(self._folder / 'log').read_text(errors='replace')}")

    @property
    def pid(self) -> int:
        """Of its first process."""
        return int((self._folder / "data/postmaster.pid").read_text().split()[0])

    def stop(self) -> None:
        """Ends it; connections are cut."""
        os.kill(self.pid, signal.SIGINT)
        self._process.wait()

    def kill(self) -> None:
        """As a power cut does to all of its processes; `start` recovers."""
        pid = self.pid
        every = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True).stdout
        for one in (pid, *map(int, every.split())):
            with suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
        self._process.wait()

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        self.stop()
        shutil.rmtree(self._folder, ignore_errors=True)
