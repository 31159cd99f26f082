"""Execute the commands of the documentation and fail where one does not end as the page says.

    python tools/run_docs.py [PAGE.md ...]        default: README.md and docs/**/*.md

Every fenced block of the kinds ``console``, ``bash`` and ``python`` carries a mark on the line
before it, an HTML comment that readers do not see:

    <!-- run -->                     run it, expect exit code 0
    <!-- run exit=4 -->              expect this exit code from its last command
    <!-- run data -->                needs the real recordings (EVERTWIN_DATA); fails in CI without
    <!-- run timeout=300 -->         seconds, default 120
    <!-- not run: reason -->         shown only; the reason is mandatory

A block without a mark is an error, so no command in the documentation goes untested unseen. In a
``console`` block the lines that start with ``$ `` are run and the rest is shown output. All blocks
of a page run in one temporary folder, in order, with the project's ``twins`` folder copied into it.
What failed is told again at the end, with the last lines of its output.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
KINDS = ("console", "bash", "python")
FENCE = re.compile(r"^(?P<fence>`{3,})\s*(?P<kind>\S*)")
LAST = 30
"""Lines of what a failed block wrote that are told again at the end."""
MARK = re.compile(r"^<!--\s*(?P<text>(?:run|not run)\b.*?)\s*-->$")


@dataclass(frozen=True)
class Block:
    """One fenced block with its mark."""

    page: Path
    line: int
    kind: str
    mark: str
    text: str

    def option(self, name: str, default: int) -> int:
        """The number behind ``name=`` in the mark."""
        found = re.search(rf"\b{name}=(\d+)", self.mark)
        return int(found[1]) if found else default

    @property
    def where(self) -> str:
        inside = self.page.is_relative_to(ROOT)
        return f"{self.page.relative_to(ROOT) if inside else self.page}:{self.line}"

    @property
    def needs_data(self) -> bool:
        return "data" in self.mark.split()

    @property
    def script(self) -> str:
        """What the shell or Python gets."""
        if self.kind != "console":
            return self.text
        lines: list[str] = []
        for line in self.text.splitlines():
            if line.startswith("$ ") or (lines and lines[-1].endswith("\\")):
                lines.append(line.removeprefix("$ "))
        return "\n".join(lines)


def blocks(page: Path) -> Iterator[Block]:
    """Every block of the kinds that can be run."""
    mark, opened, kind, start = "", "", "", 0
    text: list[str] = []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        fence = FENCE.match(line)
        if opened:
            if line.startswith(opened) and not line.strip("` "):
                if kind in KINDS:
                    yield Block(page, start, kind, mark, "\n".join(text))
                opened, mark = "", ""
            else:
                text.append(line)
        elif fence:
            opened, kind, start, text = fence["fence"], fence["kind"], number, []
        elif found := MARK.match(line.strip()):
            mark = found["text"]
        elif line.strip():
            mark = ""


def environment(home: Path) -> dict[str, str]:
    """This environment's programs first; state of the user's own is left alone."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    own = {"PATH": path, "XDG_STATE_HOME": str(home), "XDG_DATA_HOME": str(home), "NO_COLOR": "1"}
    return {"MPLBACKEND": "Agg", **os.environ, **own}


def problem(block: Block, folder: Path, home: Path) -> str:
    """Empty if the block ended as its mark says."""
    program = ["python", "-c"] if block.kind == "python" else ["bash", "-euo", "pipefail", "-c"]
    limit = block.option("timeout", 120)
    try:
        done = subprocess.run(
            [*program, block.script],
            cwd=folder,
            env=environment(home),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"took more than {limit} s"
    expected = block.option("exit", 0)
    if done.returncode == expected:
        return ""
    return f"expected exit code {expected}, got {done.returncode}\n{done.stdout}{done.stderr}"


def check(block: Block, folder: Path, home: Path) -> str:
    """One word: ok, shown, skipped or FAILED with the reason."""
    if block.mark.startswith("not run"):
        return "shown" if ":" in block.mark else "FAILED: 'not run' without a reason"
    if not block.mark:
        return "FAILED: no <!-- run --> or <!-- not run: reason --> before the block"
    if block.needs_data and not os.environ.get("EVERTWIN_DATA"):
        return "FAILED: EVERTWIN_DATA is not set" if os.environ.get("CI") else "skipped: no data"
    found = problem(block, folder, home)
    return f"FAILED: {found}" if found else "ok"


def processor() -> float:
    """Seconds that blocks have computed."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(arguments: list[str]) -> int:
    """Exit code 0 if every block ended as its page says."""
    pages = [Path(a).resolve() for a in arguments] or [
        ROOT / "README.md",
        *sorted(p for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts),
    ]
    counts: dict[str, int] = {}
    failed: list[str] = []
    for page in pages:
        with tempfile.TemporaryDirectory() as place, tempfile.TemporaryDirectory() as home:
            if (ROOT / "twins").is_dir():
                shutil.copytree(ROOT / "twins", Path(place) / "twins")
            for block in blocks(page):
                start, spent = time.monotonic(), processor()
                verdict = check(block, Path(place), Path(home))
                word = verdict.split(":")[0]
                counts[word] = counts.get(word, 0) + 1
                if word == "FAILED":
                    first, *rest = verdict.splitlines()
                    failed.append("\n".join([f"{block.where}: {first}", *rest[-LAST:]]))
                if word != "shown":
                    took = f"{time.monotonic() - start:.1f} s"
                    print(f"{block.where}: {verdict}, {took}, of a processor "
                          f"{processor() - spent:.1f} s", flush=True)  # fmt: skip
    print("documentation:", ", ".join(f"{n} {word}" for word, n in sorted(counts.items())))
    print(*failed, sep="\n", end="\n" if failed else "")
    return 1 if counts.get("FAILED") else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
