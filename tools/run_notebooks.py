"""Execute every example notebook in a temporary folder; any error in a cell fails the run.

    python tools/run_notebooks.py [NOTEBOOK ...]

A notebook finds the project's ``twins`` folder beside itself. Its stored outputs are not changed.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

ROOT = Path(__file__).parent.parent


def execute(path: Path) -> str:
    """Empty if the notebook runs, else the error's text."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as place:
        if (ROOT / "twins").is_dir():
            shutil.copytree(ROOT / "twins", Path(place) / "twins")
        client = NotebookClient(
            notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": place}}
        )
        try:
            client.execute()
        except CellExecutionError as error:
            return str(error)
    return ""


def main(arguments: list[str]) -> int:
    """Exit code 0 if every notebook runs."""
    os.environ.setdefault("MPLBACKEND", "agg")
    paths = [Path(a) for a in arguments] or sorted((ROOT / "notebooks").glob("*.ipynb"))
    failed = 0
    for path in paths:
        start = time.monotonic()
        error = execute(path)
        failed += bool(error)
        print(f"{path.name}: {'FAILED' if error else 'ok'}, {time.monotonic() - start:.1f} s")
        if error:
            print(error)
    print(f"notebooks: {len(paths) - failed} ok, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
