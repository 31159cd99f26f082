"""Runs a command and shows that it lives: its output, and a line whenever it is silent for 2 s.

python tools/alive.py "installing" pip install numpy
"""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
import time

SILENCE = 2.0
"""Longest silence [s]."""


def main(step: str, command: list[str]) -> int:
    """The command's exit code."""
    lines: queue.Queue[str | None] = queue.Queue()
    began = time.monotonic()
    print(f"{step} ...", flush=True)
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1
    ) as process:
        out = process.stdout
        assert out is not None

        def read() -> None:
            for line in out:
                lines.put(line)
            lines.put(None)

        threading.Thread(target=read, daemon=True).start()
        while True:
            try:
                line = lines.get(timeout=SILENCE)
            except queue.Empty:
                line = f"{step} ... {time.monotonic() - began:.0f} s\n"
            if line is None:
                return process.wait()
            print(line, end="", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
