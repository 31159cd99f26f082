"""Exports whose head says how they are laid out: TwinCAT Scope and LabVIEW, written here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from evertwin.errors import DataError
from evertwin.sources import inspect, open_recording
from evertwin.sources.columns.cells import Cell
from evertwin.sources.recorded import Clock, Recorded

N = 240
T = 0.002 * np.arange(N)
PLACE, SPEED, CURRENT = 100.0 + 5.0 * np.sin(30.0 * T), 150.0 * np.cos(30.0 * T), np.cos(9.0 * T)


def _read(file: Path, column: str) -> tuple[np.ndarray, np.ndarray]:
    chunks = list(Recorded("log", (file,), (Cell("y", column, "1"),), Clock()).read())
    t, y = (np.concatenate([getattr(c, name) for c in chunks]) for name in ("t", "v"))
    return t * 1e-9, y[:, 0]


def _scope(
    path: Path, sign: str = ";", comma: bool = True, shared: bool = False,
    rates: Sequence[int] = (1, 1, 1), ticks: float = 1e3, encoding: str = "utf-8",
) -> Path:  # fmt: skip
    """As the Scope's exporter writes it: a title, a head whose keys stand before each signal."""
    names = ("Axis 1.ActPos", "Axis 1.ActVelo", "Drive1.Strom größe")
    rows = [
        ("Name", names), ("SymbolComment", ("",) * 3), ("Data-Type", ("LREAL",) * 3),
        ("SampleTime[ms]", [f"{2 * r}" for r in rates]), ("VariableSize", ("8",) * 3),
        ("SymbolBased", ("True",) * 3), ("IndexGroup", ("16448",) * 3),
        ("IndexOffset", ("385000", "385008", "385016")),
        ("SymbolName", [f"Axes.{name}" for name in names]), ("NetID", ("5.24.37.1.1.1",) * 3),
        ("Port", ("501",) * 3), ("Offset", ("0",) * 3), ("ScaleFactor", ("1",) * 3),
        ("BitMask", ("0xffffffffffffffff",) * 3), ("Unit", ("mm", "mm/s (Speed)", "(None)")),
        ("Unit ScaleFactor", ("1",) * 3),
    ]  # fmt: skip
    lines = [f"Name{sign}My scope", f"File{sign}C:\\axis.tcscopex", f"Starttime of export{sign}13"]
    for key, cells in [("", ()), *rows, ("", ())]:
        first = cells[:1] if shared else ()
        every = [*first, *(cells[1:] if shared else cells)]
        lines.append(sign.join([key, *every] if shared else [c for x in every for c in (key, x)]))
    values = (PLACE, SPEED, CURRENT)
    for i in range(N):
        cells = []
        for k, (column, rate) in enumerate(zip(values, rates, strict=True)):
            there = i * rate < N
            stamp = f"{T[i] * rate * ticks:.3f}" if there else ""
            cells += [] if shared and k else [stamp]
            cells += [f"{column[i * rate]:.6f}" if there else ""]
        lines.append(sign.join(c.replace(".", ",") if comma else c for c in cells))
    path.write_bytes(("\r\n".join([*lines, ""])).encode(encoding))
    return path


@pytest.mark.parametrize(
    ("sign", "comma", "shared", "ticks", "encoding"),
    [
        (";", True, False, 1e3, "utf-8"), ("\t", False, False, 1e3, "cp1252"),
        ("\t", True, True, 1e3, "utf-8"), (";", True, False, 1.0, "utf-8"),
        (",", False, False, 1e3, "utf-8"),
    ],
)  # fmt: skip
def test_a_scope_export_is_read(
    sign: str, comma: bool, shared: bool, ticks: float, encoding: str, tmp_path: Path
) -> None:
    file = _scope(tmp_path / "axis.csv", sign, comma, shared, ticks=ticks, encoding=encoding)
    recording = open_recording(file)
    (table,) = recording.tables
    assert [(c.name, c.unit) for c in table.columns[1:]] == [
        ("Axis 1.ActPos", "mm"), ("Axis 1.ActVelo", "mm/s"), ("Drive1.Strom größe", ""),
    ]  # fmt: skip
    for name, values in zip(("Axis 1.ActPos", "Drive1.Strom größe"), (PLACE, CURRENT), strict=True):
        t, y = _read(file, name)
        np.testing.assert_allclose(t, T, atol=1e-6)
        np.testing.assert_allclose(y, values, atol=1e-5)


def test_signals_of_a_scope_with_other_rates_are_tables_of_their_own(tmp_path: Path) -> None:
    file = _scope(tmp_path / "axis.csv", rates=(1, 1, 5))
    info = inspect(file)
    assert [(t.time.rate, t.rows) for t in info.tables if t.time] == [
        (pytest.approx(500.0), N), (pytest.approx(100.0), N // 5)
    ]  # fmt: skip
    assert not any(table.loss for table in info.tables)
    np.testing.assert_allclose(_read(file, "Drive1.Strom größe")[1], CURRENT[::5], atol=1e-5)


def test_a_scope_whose_decimals_cannot_be_told_is_refused(tmp_path: Path) -> None:
    file = _scope(tmp_path / "axis.csv", ",", comma=True)
    with pytest.raises(DataError, match="decimal comma") as told:
        open_recording(file)
    assert "\n" not in str(told.value)


def _lvm(
    path: Path, stored: str = "One", sign: str = "\t", decimal: str = ".", segments: int = 1,
    comment: bool = True,
) -> Path:  # fmt: skip
    """By the vendor's specification of the format."""
    word = {"\t": "Tab", ",": "Comma"}[sign]
    put = lambda *cells: sign.join(cells)  # noqa: E731
    lines = [
        put("LabVIEW Measurement", ""), put("Writer_Version", "2"), put("Reader_Version", "2"),
        put("Separator", word), put("Decimal_Separator", decimal),
        put("Multi_Headings", "Yes" if segments > 1 else "No"), put("X_Columns", stored),
        put("Time_Pref", "Relative"), put("Operator", "lab"), put("Date", "2026/03/14"),
        put("Time", "06:00:00.1234567"), put("***End_of_Header***", ""), sign,
    ]  # fmt: skip
    number = lambda x: f"{x:.6f}".replace(".", decimal)  # noqa: E731
    for _ in range(segments):
        lines += [
            put("Channels", "3"), put("Samples", *[str(N)] * 3), put("Date", *["2026/03/14"] * 3),
            put("Y_Unit_Label", "%", "deg C", "Volts"), put("X_Dimension", *["Time"] * 3),
            put("X0", *[number(1.0)] * 3), put("Delta_X", *[number(0.002)] * 3),
            put("***End_of_Header***", "", "", ""),
        ]  # fmt: skip
        x = ["X_Value"] if stored != "Multi" else []
        names = [[*(["X_Value"] if stored == "Multi" else []), n] for n in ("Heater", "T_in", "U")]
        lines.append(put(*x, *(c for one in names for c in one), *["Comment"] * comment))
        for i in range(N):
            stamp = number(1.0 + T[i])
            row = [stamp] if stored == "One" else [""] if stored == "No" else []
            for column in (PLACE, SPEED, CURRENT):
                row += [stamp, number(column[i])] if stored == "Multi" else [number(column[i])]
            lines.append(put(*row, *["started"] * (comment and i == 0)))
    path.write_text("\r\n".join([*lines, ""]), newline="")
    return path


@pytest.mark.parametrize("stored", ["One", "No", "Multi"])
@pytest.mark.parametrize(("sign", "decimal"), [("\t", "."), ("\t", ","), (",", ".")])
def test_a_labview_file_is_read(stored: str, sign: str, decimal: str, tmp_path: Path) -> None:
    file = _lvm(tmp_path / "run.lvm", stored, sign, decimal)
    (table,) = open_recording(file).tables
    assert [(c.name, c.unit) for c in table.columns][-3:] == [
        ("Heater", "%"), ("T_in", "degC"), ("U", "volts"),
    ] or stored == "Multi"  # fmt: skip
    for name, values in (("Heater", PLACE), ("U", CURRENT)):
        t, y = _read(file, name)
        whole = slice(1, None) if len(t) < N else slice(None)  # the row of the comment
        np.testing.assert_allclose(t, (1.0 + T)[whole], atol=1e-6)
        np.testing.assert_allclose(y, values[whole], atol=1e-5)
        assert len(t) >= N - 1


def test_a_second_segment_is_refused_by_its_line(tmp_path: Path) -> None:
    file = _lvm(tmp_path / "run.lvm", segments=2, comment=False)
    with pytest.raises(DataError, match=r"run\.lvm:270: another segment"):
        _read(file, "U")


def test_a_labview_file_that_breaks_off_in_its_head_is_refused(tmp_path: Path) -> None:
    file = _lvm(tmp_path / "run.lvm")
    file.write_bytes(file.read_bytes()[:200])
    with pytest.raises(DataError, match="cut off"):
        open_recording(file)
