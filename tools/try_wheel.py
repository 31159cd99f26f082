"""Install the newest wheel of a folder into an empty environment and use it there.

python tools/try_wheel.py dist
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROBE = """
import importlib.resources, pathlib, sys, evertwin
assert all(hasattr(evertwin, name) for name in evertwin.__all__)
assert importlib.resources.files("evertwin").joinpath("py.typed").is_file()
images = importlib.resources.files("evertwin.features.images")
assert images.joinpath("data", "objects.onnx").is_file()
assert pathlib.Path(sys.prefix) in pathlib.Path(evertwin.__file__).parents, evertwin.__file__
"""


def main(folder: Path) -> int:
    """Exit code 0 if the wheel installs, imports and answers on the command line."""
    wheel = max(folder.resolve().glob("*.whl"), key=lambda path: path.stat().st_mtime)
    with tempfile.TemporaryDirectory() as place:
        venv.create(place, with_pip=True)
        bin_ = Path(place) / "bin"
        install = [bin_ / "python", "-m", "pip", "install", "--quiet", "--no-compile", "-c"]
        for command in (
            [*install, ROOT / "constraints.txt", wheel],
            [bin_ / "python", "-c", PROBE],
            [bin_ / "evertwin", "--help"],
        ):
            done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
            if done.returncode:
                print(done.stdout + done.stderr)
                return done.returncode
    print(f"{wheel.name}: installed into an empty environment, imported, run")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
