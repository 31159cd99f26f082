"""LabVIEW measurement files (.lvm): a head of tags, one of the channels, then their columns.

The head says separator and decimal sign, units and which stamps are stored: none (``X_Columns
No``: the first cell of a row is empty and ``X0``, ``Delta_X`` tell them), one column, or one for
each channel (``Multi``). Another segment below the first begins anew and is refused where it is
read.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evertwin.errors import DataError
from evertwin.sources.columns.table import Recording
from evertwin.sources.sniff import opened
from evertwin.sources.texts.dialect import cells_of, encoding_of, shown
from evertwin.sources.texts.laid_out import HEAD, Head, parts_of_text, spelled, top_of

MAGIC = b"LabVIEW Measurement"
_END = b"***End_of_Header***"


def open_lvm(path: Path) -> Recording:
    """The channels of a LabVIEW measurement file.

    Raises:
        DataError: its head is cut off, or has no channels.
    """
    lines = top_of(path)
    ends = [i for i, line in enumerate(lines) if line.startswith(_END)][:2]
    if len(ends) < 2 or ends[1] + 1 >= len(lines):
        raise DataError(f"{path.name}: the head of its channels is cut off: save it again")
    _check_segments(path)
    sign = b"," if _tag(lines[: ends[0]], b"Separator", None)[:1] == [b"Comma"] else b"\t"
    at = ends[1] + 1
    names = tuple(cells_of(lines[at], sign))
    channels = lines[ends[0] + 1 : ends[1]]
    if len(names) < 2:
        raise DataError(f"{path.name}: it has no channels: save it again")
    stored = (_tag(lines[: ends[0]], b"X_Columns", sign) or [b"One"])[0].lower()
    comma = (_tag(lines[: ends[0]], b"Decimal_Separator", sign) or [b"."])[0] != b"."
    columns = [j for j, name in enumerate(names) if name.strip() not in (b"Comment", b"")]
    values = [j for j in columns if not names[j].startswith(b"X_Value")]
    encoding = encoding_of(lines[:at])
    said = [spelled(shown(unit, encoding)) for unit in _tag(channels, b"Y_Unit_Label", sign)]
    of_time = (_tag(channels, b"X_Dimension", sign) or [b"Time"])[0] == b"Time"
    units = ["s" if of_time and j not in values and j in columns else "" for j in range(len(names))]
    for j, unit in zip(values, said, strict=False):
        units[j] = unit
    clocks: list[tuple[int | None, tuple[int, ...]]] = [(0, tuple(values))]
    if stored == b"no":
        clocks = [(None, tuple(values))]
    elif stored == b"multi":
        clocks = [(j - 1, (j,)) for j in values]
    start, step = (_number(channels, tag, sign) for tag in (b"X0", b"Delta_X"))
    if stored == b"no" and not step > 0.0:
        raise DataError(f"{path.name}: it stores no stamps, and Delta_X is {step:g}: save them")
    head = Head(
        sign, comma and sign != b",", names, tuple(units), at + 1, tuple(clocks), start, step
    )
    return Recording(path, "csv", parts_of_text(path, head, lines))


def _check_segments(path: Path) -> None:
    """Refuses a second head of channels.

    Raises:
        DataError: another segment begins; its line is given.
    """
    count, line, rest = 0, 1, b""
    with opened(path) as file:
        while data := file.read(HEAD):
            text = rest + data
            whole, _, rest = text.rpartition(b"\n")
            for part in whole.split(_END)[:-1] if _END in whole else ():
                line += part.count(b"\n")
                count += 1
                if count > 2:
                    raise DataError(
                        f"{path.name}:{line}: another segment ends its head here: save each "
                        "segment as a file of its own"
                    )
            line += (whole.rpartition(_END)[2] + b"\n").count(b"\n")


def _tag(lines: Sequence[bytes], name: bytes, sign: bytes | None) -> list[bytes]:
    """The cells behind a tag; empty where it is not there."""
    for line in lines:
        if line.startswith(name) and line[len(name) : len(name) + 1] in (b"\t", b","):
            cells = line.split(line[len(name) : len(name) + 1] if sign is None else sign)
            if name == b"Decimal_Separator" and sign == b",":
                return [b"."]
            return [cell.strip() for cell in cells[1:]]
    return []


def _number(lines: Sequence[bytes], name: bytes, sign: bytes) -> float:
    found = _tag(lines, name, sign)
    try:
        return float(found[0].replace(b",", b".")) if found else 0.0
    except ValueError:
        return 0.0
