"""Texts that once crashed, hung or were believed: each with the sentence that it must end in.

``HEADINGS`` stand in a recording, ``SETTINGS`` in a twin file.
"""

from __future__ import annotations

from tests.edge.seeds import LIFE, TWIN, Seed, drive, table

__all__ = ["TEXTS"]

RUN = ("run", "{file}")
INIT = ("init", "{file}", "-o", "made.toml")
INFO = ("info", "{file}", "--check")
CHECK = ("run", "robot.toml", "--check")

HEADINGS = {
    "9^999999999": "not known", "m/0": "not known", "9**9**9**9": "not known",
    "m/" * 900 + "s": "not known", "(m" * 300: "not known", "dB": "logarithmic",
    "dBm": "logarithmic",
}  # fmt: skip
SETTINGS = {
    'vote = 8': {"vote = 1000000000000": "at most", "vote = 1e12": "whole number",
                 f"vote = {'9' * 400}": "64 bits", f"vote = 0x{'f' * 300}": "64 bits"},
    "beat = 20": {"beat = 1000000000000": "1 to 1000000 rows", "beat = -1": "1 to 1000000 rows"},
    "window = 40": {"window = 1000000000000": "1 to 1000000 rows",
                    'window = "1e6 s"': "at most 1000000"},
    'gap = "10 s"': {'gap = "1__0 m"': "not known", 'gap = "5 m/0"': "not known",
                     f'gap = "{"9" * 400} s"': "'2 cm'", 'gap = "1e999 s"': "at most 1e308",
                     "gap = nan": "a number", 'gap = "5 dBm"': "logarithmic",
                     'rate = "1e12 Hz"': "at most", "rate = 1e-300": "at least",
                     'gap = "9^999999999 s"': "not known"},
    'unit = "cm/s"': {'unit = "9^999999999 m/s"': "not known", 'unit = "dB"': "logarithmic"},
    'low = "-1 km"': {f"low = {'[' * 2000}{']' * 2000}": "inside one another",
                      f"low = {'{a=' * 2000}1{'}' * 2000}": "inside one another",
                      f"low = {{ {'a.' * 2000}a = 1 }}": "inside one another",
                      "low = [\n" + "1,\n" * 20_000 + "]": "at most 10000 elements",
                      'low = """\n' + "a\n" * 60_000 + '"""': "expected"},
    "limit = 18": {f"limit = \"{'(' * 900}\"": "expected", 'limit = "9**9**9**9 Nm"': "not known"},
}  # fmt: skip


def _texts() -> dict[str, tuple[Seed, tuple[str, ...], int, str]]:
    out: dict[str, tuple[Seed, tuple[str, ...], int, str]] = {}
    for unit, said in HEADINGS.items():
        content = table(head=(f"t [s],x [{unit}],y",))
        out[f"heading [{unit[:16]}], info"] = Seed("a.csv", content), INFO, 1, said
        out[f"heading [{unit[:16]}], init"] = Seed("a.csv", content), INIT, 0, said
    twin, beside = (TWIN + LIFE).decode(), {"run.csv": drive()}
    for old, new in SETTINGS.items():
        for text, said in new.items():
            assert twin.count(old) == 1, old
            content = twin.replace(old, text).encode()
            out[f"setting {text[:40]}"] = Seed("robot.toml", content, (), beside), RUN, 2, said
    rows = drive().decode().splitlines()
    backward = "\n".join([rows[0], *reversed(rows[1:])]) + "\n"
    whole = [row.split(",", 1) for row in rows[1:]]
    nanos = "\n".join([rows[0], *(f"{round(float(t) * 1e9)},{rest}" for t, rest in whole)]) + "\n"
    for name, content, said in (
        ("descending stamps", backward, "sort the rows by time"),
        ("nanoseconds read as seconds", nanos, "10^9 times too long"),
    ):
        for how, code, settings in (
            ("in rows", 1, TWIN.replace(b'window = "10 s"', b"window = 100")), ("in time", 4, TWIN),
        ):  # fmt: skip
            seed = Seed("run.csv", content.encode(), (), {"robot.toml": settings})
            out[f"{name}, windows {how}"] = seed, CHECK, code, said
    for name, head, said in (
        ("Windows-1252", "Zeit [s],Weg rückwärts [µm],y".encode("cp1252"), "Weg rückwärts"),
        ("three heading lines", b"Time,Way along x,Way\ns,m,mm\nt,x,y", "Way along x"),
    ):
        content = head + b"\n" + table(head=())
        out[name] = Seed("a.csv", content), ("info", "{file}"), 0, said
    return out


TEXTS = _texts()
"""Name → file, command, exit code, a piece of what is said."""
