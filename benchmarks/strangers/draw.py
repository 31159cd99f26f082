"""The families, and one drawn machine as plain files: `FAMILY-SEED/` with its recordings.

Two sets. `known`: effects that a correction term has a name for. `late`: written by somebody who
had not seen this software, before the last term was added, and fixed since by the hash of the
files; no term may be added for what fails there.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

Columns = dict[str, np.ndarray]
HERE = Path(__file__).parent
FIXED = "HASH"
"""File of a set with the SHA-256 of its Python files."""


def names(group: str) -> tuple[str, ...]:
    """Families of a set: its files that draw a machine."""
    files = sorted((HERE / group).glob("*.py"))
    return tuple(f.stem for f in files if "def draw(seed: int)" in f.read_text())


def fingerprint(group: str) -> str:
    """SHA-256 over names and content of a set's Python files."""
    found = hashlib.sha256()
    for file in sorted((HERE / group).glob("*.py")):
        found.update(file.name.encode() + b"\0" + file.read_bytes())
    return found.hexdigest()


def machine(group: str, family: str, seed: int) -> Any:
    """One drawn machine."""
    for folder in ("late", group):
        if str(HERE / folder) not in sys.path:
            sys.path.insert(0, str(HERE / folder))
    return importlib.import_module(family).draw(seed)


def write(group: str, family: str, seed: int, folder: Path) -> Path:
    """The machine's files: three of four recordings to learn from, the others to be scored on."""
    drawn, place = machine(group, family, seed), folder / f"{family}-{seed:04d}"
    place.mkdir(parents=True, exist_ok=True)
    count = len(drawn.recordings)
    for k, columns in enumerate(drawn.recordings):
        part = "train" if k < count - max(count // 4, 1) else "test"
        named = {f"{name} [{drawn.units[name]}]": values for name, values in columns.items()}
        save(place / f"{part}_{k}.csv", named)
        if part == "test":
            clean = drawn.own(columns, drawn.starts[k], drawn.own_true)
            own = anchored(drawn.nominal.form, drawn.nominal.roles, columns, clean, drawn.horizon)
            save(place / f"own_{k}.csv", own)
    about = {
        "form": drawn.nominal.form, "text": drawn.nominal.text,
        "parameters": drawn.nominal.parameters, "roles": drawn.nominal.roles,
        "units": drawn.units, "inputs": drawn.inputs, "outputs": drawn.outputs,
        "horizon": drawn.horizon, "noise": drawn.noise,
    }  # fmt: skip
    (place / "machine.json").write_text(json.dumps(about, indent=1))
    return place


def anchored(
    form: str, roles: dict[str, str], measured: Columns, clean: Columns, horizon: float
) -> Columns:
    """The true form's predictions, each from the measurement at the start of its horizon."""
    found = {name: values.copy() for name, values in clean.items()}
    if form == "drive":
        return found
    for a, b in windows(measured["t"], horizon):
        part = slice(a + 1, b + 1)
        off = {name: measured[name][a] - clean[name][a] for name in clean}
        if form == "base":
            x, y, heading = (roles[role] for role in ("x", "y", "heading"))
            way = [clean[name][part] - clean[name][a] for name in (x, y)]
            c, s = np.cos(off[heading]), np.sin(off[heading])
            found[x][part] = measured[x][a] + c * way[0] - s * way[1]
            found[y][part] = measured[y][a] + s * way[0] + c * way[1]
            found[heading][part] += off[heading]
        else:  # a tank forgets where it began; its horizon is one time constant
            t = measured["t"][part] - measured["t"][a]
            fade = np.exp(-t / horizon) if form == "tank" else 1.0
            for name in clean:
                found[name][part] += off[name] * fade
    return found


def windows(t: np.ndarray, horizon: float) -> list[tuple[int, int]]:
    """First and last row of each prediction: the last of one is the first of the next."""
    step = max(round(horizon / float(np.median(np.diff(t)))), 1)
    return [(a, min(a + step, len(t) - 1)) for a in range(0, len(t) - 1, step)]


def save(file: Path, columns: Columns) -> None:
    """Columns of equal length, as text."""
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(file, rows, "%.9g", ",", header=",".join(columns), comments="")


def read(file: Path) -> Columns:
    """Columns of a recording, by name."""
    with file.open() as lines:
        header = [part.split(" [")[0].strip() for part in lines.readline().split(",")]
    rows = np.loadtxt(file, delimiter=",", skiprows=1, ndmin=2)
    return dict(zip(header, rows.T, strict=True))
