"""Broken recordings, generated. Each row of a whole file obeys x = 10·t + 0.25 and y = −20·t, so
that a single wrong number in what was read shows.
"""

from __future__ import annotations

import gzip
import io
import json
import pickle
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import mcap.writer
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

N = 200
T = np.arange(N) / 10
X = 10 * T + 0.25
Y = -20 * T


def lines(delimiter: str = ",", decimal: str = ".", head: str = "t,x,y") -> list[str]:
    rows = [head.replace(",", delimiter)] if head else []
    for t, x, y in zip(T, X, Y):
        rows.append(delimiter.join(f"{v:.2f}" for v in (t, x, y)).replace(".", decimal))
    return rows


def text(rows: list[str], end: str = "\n", last: bool = True) -> bytes:
    return (end.join(rows) + (end if last else "")).encode()


def edited(line: int, new: str) -> bytes:
    rows = lines()
    rows[line] = new
    return text(rows)


def arrays(**more: object) -> dict[str, object]:
    return {"t": T, "x": X, "y": Y, **more}


def mat(**more: object) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, arrays(**more))
    return buffer.getvalue()


def npz(**more: object) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays(**more))  # type: ignore[arg-type]
    return buffer.getvalue()


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def parquet(**more: object) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(pa.table(arrays(**more)), buffer)
    return buffer.getvalue()


def mcap_file(
    payload: Callable[[int], bytes] | None = None, encoding: str = "json", chunk: int = 2000
) -> bytes:
    buffer = io.BytesIO()
    writer = mcap.writer.Writer(buffer, chunk_size=chunk)
    writer.start()
    schema = writer.register_schema("drive", "jsonschema", b"{}")
    channel = writer.register_channel("/drive", encoding, schema)
    for i in range(N):
        content = json.dumps({"x": X[i], "y": Y[i]}).encode()
        data = content if payload is None else payload(i)
        stamp = round(T[i] * 1e9)
        writer.add_message(channel, stamp, data, stamp)
    writer.finish()
    return buffer.getvalue()


def db3(tables: bool = True, type_: str = "std_msgs/msg/Float64") -> bytes:
    link = sqlite3.connect(":memory:")
    if tables:
        link.execute(
            "CREATE TABLE topics(id INTEGER, name TEXT, type TEXT, serialization_format TEXT)"
        )
        link.execute(
            "CREATE TABLE messages(id INTEGER, topic_id INTEGER, timestamp INTEGER, data BLOB)"
        )
        link.execute("INSERT INTO topics VALUES(1, '/x', ?, 'cdr')", (type_,))
        for i in range(N):
            data = b"\0\1\0\0" + struct.pack("<d", X[i])
            link.execute("INSERT INTO messages VALUES(?,1,?,?)", (i, round(T[i] * 1e9), data))
    else:
        link.execute("CREATE TABLE notes(a TEXT)")
    link.commit()
    return bytes(link.serialize())


class Canary:
    """Touches a file if it is ever unpickled."""

    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        return (open, (self.path, "w"))


def cut(content: bytes, share: float) -> bytes:
    return content[: int(len(content) * share)]


def flipped(content: bytes, share: float) -> bytes:
    at = int(len(content) * share)
    return content[:at] + bytes([content[at] ^ 0xFF]) * 8 + content[at + 8 :]


def zipped(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def big_header(shape: tuple[int, ...]) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return buffer.getvalue()


def stamps(change: Callable[[np.ndarray], np.ndarray]) -> bytes:
    t = change(np.rint(T * 1000).astype(np.int64))
    rows = [f"{a},{x:.2f},{y:.2f}" for a, x, y in zip(t, X, Y)]
    return text(["time_ms,x,y", *rows])


def _set(i: int, value: int) -> Callable[[np.ndarray], np.ndarray]:
    def change(t: np.ndarray) -> np.ndarray:
        t = t.copy()
        t[i] = value
        return t

    return change


def build(folder: Path) -> dict[str, tuple[bytes, str]]:
    """File name → (content, what must happen): read, refused, any, or the problem counted."""
    canary = str(folder / "canary")
    loot = pickle.dumps(Canary(canary))
    whole = text(lines())
    good: dict[str, tuple[bytes, str]] = {
        "plain.csv": (whole, "read"),
        "no_header.csv": (text(lines(head="")), "read"),
        "semicolon_decimal_comma.csv": (text(lines(";", ",")), "read"),
        "tab_decimal_comma.tsv": (text(lines("\t", ",")), "read"),
        "blanks.txt": (text(lines("  ")), "read"),
        "bom.csv": (b"\xef\xbb\xbf" + whole, "read"),
        "crlf.csv": (text(lines(), "\r\n"), "read"),
        "comments.csv": (b"# made by x\n%y\n// z\n" + whole, "read"),
        "blank_lines.csv": (whole.replace(b"\n", b"\n\n"), "read"),
        "packed.csv.gz": (gzip.compress(whole), "read"),
        "wrong_suffix.parquet": (whole, "read"),
        "csv_that_is_parquet.csv": (parquet(), "read"),
        "units_line.csv": (text([lines()[0], "s,m,m", *lines()[1:]]), "read"),
        "quoted.csv": (
            text(
                [lines()[0], *(f'"{r.replace(",", chr(34) + "," + chr(34))}"' for r in lines()[1:])]
            ),
            "read",
        ),
        "closing_comma.csv": (text([r + "," for r in lines()]), "read"),
        "extra_column.csv": (text([r + ",note" for r in lines()]), "read"),
        "fixed_decimals_open_end.csv": (text(lines(), last=False), "read"),
    }
    text_faults: dict[str, tuple[bytes, str]] = {
        "empty.csv": (b"", "refused"),
        "only_header.csv": (b"t,x,y\n", "refused"),
        "only_comments.csv": (b"# a\n# b\n", "refused"),
        "cut_in_number.csv": (whole[:-3], "cut_off"),
        "cut_in_row.csv": (cut(whole, 0.503), "any"),
        "truncated_row.csv": (edited(50, "4.90,49.25"), "truncated"),
        "overlong_row.csv": (edited(50, "4.90,49.25,-98.00,7"), "overlong"),
        "two_rows_in_one_line.csv": (edited(50, "4.90,49.25,-98.005.00,50.25,-100.00"), "overlong"),
        "word_in_numbers.csv": (edited(50, "4.90,ERROR,-98.00"), "text"),
        "word_in_stamps.csv": (edited(50, "later,49.25,-98.00"), "refused"),
        "underscore_number.csv": (edited(50, "4.90,4_9.25,-98.00"), "refused"),
        "thousands.csv": (edited(50, '4.90,"1,049.25",-98.00'), "refused"),
        "empty_cells.csv": (edited(50, "4.90,,-98.00"), "read"),
        "nan_words.csv": (edited(50, "4.90,N/A,-98.00"), "read"),
        "infinite.csv": (edited(50, "4.90,inf,-98.00"), "read"),
        "no_stamp.csv": (edited(50, ",49.25,-98.00"), "no_stamp"),
        "zero_bytes.csv": (edited(150, "\0\0\0\0\0\0"), "any"),
        "zero_bytes_on_top.csv": (b"\0" * 100 + whole, "refused"),
        "missing_column.csv": (text([r.rpartition(",")[0] for r in lines()]), "refused"),
        "renamed_column.csv": (whole.replace(b"t,x,y", b"t,x_m,y"), "refused"),
        "decimal_comma_with_commas.csv": (
            text([lines()[0], *(r.replace(".", ",") for r in lines(head=""))]),
            "refused",
        ),
        "mixed_decimal.csv": (edited(50, "4.90;49.25;-98.00"), "truncated"),
        "utf16.csv": ("\ufefft,x\n0,1\n".encode("utf-16-le"), "refused"),
        "web_page.csv": (b"<!DOCTYPE html><html>not found</html>", "refused"),
        "lfs_pointer.csv": (b"version https://git-lfs.github.com/spec/v1\noid x\n", "refused"),
        "long_line.csv": (b"t,x,y\n" + b"1" * (3 << 20), "refused"),
        "cut.csv.gz": (gzip.compress(whole)[:-30], "any"),
        "damaged.csv.gz": (flipped(gzip.compress(whole), 0.5), "any"),
        "gzip_of_tar.csv.gz": (gzip.compress(b"a" * 257 + b"ustar" + b"b" * 300), "refused"),
        "gzip_of_pickle.csv.gz": (gzip.compress(loot), "refused"),
        "bzip2.csv": (b"BZh91AY&SY", "refused"),
        "excel.xlsx": (zipped({"xl/workbook.xml": b"<x/>"}), "refused"),
        "mixed_zones.csv": (
            text(["time,x,y"] + [
                f"2021-03-04T12:00:{i:02d}{'Z' if i % 2 else ''},{X[i]},{Y[i]}" for i in range(50)
            ]),
            "refused",
        ),
        "bad_date.csv": (
            text(["time,x,y", "2021-02-27T12:00:00Z,1,1", "2021-02-30T12:00:01Z,1,1"]), "refused",
        ),
        "unclear_unit.csv": (
            text(["t,x,y"] + [f"{int(20 * i)},{i},{i}" for i in range(50)]), "refused",
        ),
        "duplicate_columns.csv": (whole.replace(b"t,x,y", b"t,x,x"), "refused"),
    }  # fmt: skip
    clock_faults: dict[str, tuple[bytes, str]] = {
        "repeated_stamp.csv": (stamps(_set(50, 4900)), "repeated"),
        "backward_stamp.csv": (stamps(_set(50, 1000)), "backward"),
        "far_future_stamp.csv": (stamps(_set(50, 2**40)), "clock_jump"),
        "absurd_stamp.csv": (stamps(_set(50, 2**62)), "no_stamp"),
        "first_stamp_absurd.csv": (stamps(_set(0, -(10**12))), "clock_jump"),
        "clock_set_back.csv": (
            stamps(lambda t: np.where(np.arange(N) < 100, t + 10**10, t)), "clock_set",
        ),
        "clock_set_ahead.csv": (
            stamps(lambda t: np.where(np.arange(N) < 100, t, t + 75 * 31_536_000_000)),
            "clock_set",
        ),
        "pause.csv": (stamps(lambda t: np.where(np.arange(N) < 100, t, t + 10**8)), "gap"),
        "shuffled.csv": (stamps(lambda t: np.random.default_rng(0).permutation(t)), "any"),
        "all_equal_stamps.csv": (stamps(lambda t: t * 0 + 5), "any"),
        "reversed.csv": (stamps(lambda t: t[::-1]), "any"),
    }  # fmt: skip
    objects = np.array([{"a": 1}, None], dtype=object)
    struct_mat = mat(log={"speed": X, "on": np.ones(N, bool)})
    binary_faults: dict[str, tuple[bytes, str]] = {
        "good.mat": (mat(), "read"),
        "structure.mat": (struct_mat, "read"),
        "cells.mat": (mat(c=np.array(["a", 1.0], dtype=object)), "read"),
        "other_lengths.mat": (mat(k=np.ones(7), kp=3.0), "read"),
        "cut.mat": (cut(mat(), 0.6), "refused"),
        "cut_head.mat": (mat()[:120], "refused"),
        "damaged.mat": (flipped(mat(), 0.03), "any"),
        "no_vectors.mat": (mat_of(a=1.0), "refused"),
        "v73.mat": (b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + b" " * 400, "refused"),
        "hdf5.mat": (b"\x89HDF\r\n\x1a\n" + b"\0" * 600, "refused"),
        "good.parquet": (parquet(), "read"),
        "cut.parquet": (cut(parquet(), 0.7), "refused"),
        "damaged.parquet": (flipped(parquet(), 0.3), "any"),
        "no_footer.parquet": (parquet()[:-4] + b"XXXX", "refused"),
        "no_rows.parquet": (parquet_of(t=[], x=[]), "refused"),
        "text_column.parquet": (parquet_of(t=T, x=["a"] * N, y=Y), "refused"),
        "nested.parquet": (parquet(path=[[1.0, 2.0]] * N), "read"),
        "nulls.parquet": (parquet_of(t=T, x=[None, *X[1:]], y=Y), "read"),
        "good.npz": (npz(), "read"),
        "objects.npz": (npz(o=objects), "refused"),
        "pickle_inside.npz": (npz(o=np.array([Canary(canary)], dtype=object)), "refused"),
        "cut.npz": (cut(npz(), 0.5), "refused"),
        "damaged.npz": (flipped(npz(), 0.1), "any"),
        "claims_too_much.npz": (zipped({"t.npy": big_header((10**11,))}), "refused"),
        "traversal.npz": (zipped({"../../t.npy": npy(T), "x.npy": npy(X), "y.npy": npy(Y)}), "any"),
        "good.npy": (npy(np.rec.fromarrays([T, X, Y], names="t,x,y")), "read"),
        "objects.npy": (npy(np.array([Canary(canary), None], dtype=object)), "refused"),
        "cut.npy": (cut(npy(X), 0.5), "refused"),
        "claims_too_much.npy": (big_header((10**12,)) + b"\0" * 80, "refused"),
        "good.pkl": (loot, "refused"),
        "pickle_as_csv.csv": (loot, "refused"),
        "pickle_protocol_0.pkl": (pickle.dumps([1, 2], 0), "refused"),
        "random.bin": (np.random.default_rng(1).bytes(5000), "refused"),
    }  # fmt: skip
    bag_faults: dict[str, tuple[bytes, str]] = {
        "good.mcap": (mcap_file(), "read"),
        "cut.mcap": (cut(mcap_file(), 0.5), "cut_off"),
        "no_summary.mcap": (cut(mcap_file(), 0.9), "cut_off"),
        "damaged.mcap": (flipped(mcap_file(), 0.1), "read"),
        "damaged_chunk.mcap": (flipped(mcap_file(chunk=1 << 20), 0.2), "refused"),
        "head_only.mcap": (mcap_file()[:20], "refused"),
        "protobuf.mcap": (mcap_file(encoding="protobuf"), "refused"),
        "not_json.mcap": (mcap_file(lambda i: b"{"), "refused"),
        "half_not_json.mcap": (
            mcap_file(lambda i: b"[" if i % 2 else json.dumps({"x": X[i], "y": Y[i]}).encode()),
            "damaged",
        ),
        "field_vanishes.mcap": (
            mcap_file(lambda i: json.dumps({"x": X[i], **({"y": Y[i]} if i < 9 else {})}).encode()),
            "truncated",
        ),
        "no_tables.db3": (db3(tables=False), "refused"),
        "cut.db3": (cut(db3(), 0.5), "refused"),
        "unknown_type.db3": (db3(type_="my_msgs/msg/Secret"), "refused"),
        "head_only.bag": (b"#ROSBAG V2.0\n", "refused"),
        "old.bag": (b"#ROSBAG V1.2\n" + b"\0" * 90, "refused"),
        "noise.bag": (b"#ROSBAG V2.0\n" + np.random.default_rng(2).bytes(4000), "refused"),
    }  # fmt: skip
    return {**good, **text_faults, **clock_faults, **binary_faults, **bag_faults}


def mat_of(**content: object) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, content)
    return buffer.getvalue()


def parquet_of(**content: object) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(pa.table(content), buffer)
    return buffer.getvalue()
