"""What files from elsewhere can do to a twin: `python -m proofs.bad_files [MUTATIONS]`.

M1 archives, M2 XML, M3 pickles, M4 FMUs that misbehave, M5 URDFs, M6 models that diverge, M7
mutated twin files. Corpora are generated (`tests/models/fmu/corpus.py`); files and connections are
counted by Python's audit hooks, so a read that no message tells is counted too. Needs a C compiler.
"""

from __future__ import annotations

import logging
import os
import random
import sys
import tempfile
import threading
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from evertwin import FunctionModel, Layout, Parameters, Twin, TwinSpec
from evertwin.config import reads, spec
from evertwin.errors import ConfigError, EvertwinError
from evertwin.machines.arm import urdf
from evertwin.models.fmu import Fmu, fmu
from evertwin.models.fmu.description import parse_description
from evertwin.models.mujoco import model_of_file
from evertwin.sources.info import inspect
from evertwin.store import SqliteStore
from tests.models.fmu import corpus
from tests.models.fmu.native import BAD, build, description, library

FAST = {"row_seconds": 0.5, "memory_mb": 400.0}
MEGABYTE = 1e6


class Watch:
    """Counts what this process opens, connects to and unpickles."""

    def __init__(self) -> None:
        self.opened: list[str] = []
        self.connected = self.unpickled = 0
        self.on = False
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event == "open":
            self.opened.append(str(arguments[0]))
        elif event in ("socket.connect", "socket.getaddrinfo", "urllib.Request"):
            self.connected += 1
        elif event == "pickle.find_class":
            self.unpickled += 1


@contextmanager
def disk(folder: Path) -> Iterator[list[int]]:
    """The largest size of a folder while the body runs, looked at every 5 ms."""
    peak, done = [0], threading.Event()

    def look() -> None:
        while not done.is_set():
            total = 0
            for path in list(folder.rglob("*")):
                try:
                    total += path.stat().st_size if path.is_file() else 0
                except OSError:
                    continue
            peak[0] = max(peak[0], total)
            time.sleep(0.005)

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield peak
    finally:
        done.set()
        thread.join()


def refusal(call: Callable[[], object]) -> str:
    """The message of one of our errors; empty where there was none; anything else passes on."""
    try:
        call()
    except EvertwinError as error:
        return str(error)
    return ""


def archives(root: Path) -> bool:
    """M1."""
    inside, bad, unpacked = root / "in", root / "out", root / "temporary"
    for folder in (inside, bad, unpacked):
        folder.mkdir()
    usual, tempfile.tempdir = tempfile.tempdir, str(unpacked)
    count = escapes = accepted = written = 0
    most_memory = most_disk = 0.0
    for name, raw in corpus.archives():
        file = inside / "bad.fmu"
        file.write_bytes(raw)
        del raw
        tracemalloc.start()
        with disk(unpacked) as peak:
            said = refusal(lambda file=file: fmu(file, memory="none"))  # type: ignore[misc]
        most_memory = max(most_memory, tracemalloc.get_traced_memory()[1] / MEGABYTE)
        tracemalloc.stop()
        count, accepted = count + 1, accepted + (not said)
        most_disk, written = max(most_disk, peak[0] / MEGABYTE), written + (peak[0] > 0)
        escapes += len([p for p in root.rglob("*") if p.is_file() and p != file])
        print(f"    {name}: {said[:110] or 'ACCEPTED'}")
    tempfile.tempdir = usual
    strange = [p for p in (Path("/tmp/escape.txt"), Path("/escape.txt")) if p.exists()]
    escapes += len(strange)
    print(
        f"M1 archives: {count} refused {count - accepted}, escapes {escapes} of {count}, "
        f"{written} began to unpack; peak disk {most_disk:.2f} MB, peak memory {most_memory:.1f} MB"
    )
    return escapes == 0 and accepted == 0


def texts(root: Path, watch: Watch) -> bool:
    """M2."""
    canary = root / "canary.txt"
    canary.write_text("SECRET-OF-THE-CANARY")
    readers: dict[str, tuple[str, Callable[[Path], object]]] = {
        "modelDescription.xml": (
            "fmiModelDescription", lambda p: parse_description(p.read_bytes(), p.name),
        ),
        "robot.urdf": ("robot", urdf.read),
        "scene.xml": ("mujoco", lambda p: model_of_file(file=str(p))),
    }  # fmt: skip
    count = reads_ = leaks = accepted = 0
    slowest = 0.0
    watch.opened, watch.connected = [], 0
    for name, (top, reader) in readers.items():
        for _, text in corpus.xml_texts(canary, 9):
            file = root / name
            file.write_text(text.replace("fmiModelDescription", top))
            watch.on, began = True, time.perf_counter()
            said = refusal(lambda reader=reader, file=file: reader(file))  # type: ignore[misc]
            watch.on, slowest = False, max(slowest, time.perf_counter() - began)
            count, accepted = count + 1, accepted + (not said)
            leaks += "SECRET" in said
    reads_ = sum("canary" in name for name in watch.opened)
    print(
        f"M2 XML: {count} texts in {len(readers)} readers, refused {count - accepted}, canary read "
        f"{reads_}, connections {watch.connected}, leaks {leaks}, slowest {slowest:.2f} s"
    )
    return reads_ == watch.connected == leaks == accepted == 0


def pickled(root: Path, watch: Watch) -> bool:
    """M3."""
    canary = root / "fired"
    readers: tuple[Callable[[Path], object], ...] = (
        inspect, lambda p: fmu(p, memory="none"), urdf.read, lambda p: model_of_file(file=str(p)),
        lambda p: SqliteStore(str(p)), lambda p: reads(p.read_text(errors="replace")),
    )  # fmt: skip
    count = tried = 0
    watch.unpickled = 0
    for _, ending, raw in corpus.pickles(canary):
        count += 1
        for reader in readers:
            file = root / f"poison{ending}"
            file.write_bytes(raw)
            watch.on, tried = True, tried + 1
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                refusal(lambda reader=reader, file=file: reader(file))  # type: ignore[misc]
            watch.on = False
    print(
        f"M3 pickles: {count} files, {tried} readings, canary fired {int(canary.exists())}, "
        f"classes looked up by pickle {watch.unpickled}"
    )
    return not canary.exists() and watch.unpickled == 0


def misbehaving(root: Path) -> bool:
    """M4."""
    u = 4.0 * np.sin(0.02 * np.arange(100.0))[:, None]
    u[40], dt = 1000.0, np.full(100, 0.01)
    total = survived = 0
    crash = hang = 0.0
    for interface in ("co-simulation", "model-exchange"):
        for three in (False, True):
            for bad in (name for name in BAD if name not in ("", "jump", "load")):
                if bad == "stack" and interface == "model-exchange":
                    continue
                total += 1
                file = build(root / f"{bad}{three}{interface}", bad=bad, three=three)
                model = fmu(file, interface=interface, **FAST)
                p = model.parameters.values
                _, y = model.simulate(model.initial(p), u, dt, p)
                lost = np.flatnonzero(np.isnan(y).any(axis=1)).tolist()
                fault = model.faults[0] if model.faults else None
                good = lost == [40] and fault is not None and model.worker.alive
                survived += good
                if fault is not None and fault.kind == "hung":
                    hang = max(hang, fault.seconds - FAST["row_seconds"])
                elif fault is not None:
                    crash = max(crash, fault.seconds)
                said = f"{fault.kind} ({fault.detail}), {fault.seconds:.3f} s" if fault else "?"
                print(f"    FMI {3 if three else 2} {interface} {bad}: {said}; rows lost {lost}")
                model.close()
    for name, file in packages(root):
        total += 1
        said = refusal(lambda file=file: fmu(file, **FAST))  # type: ignore[misc]
        survived += bool(said)
        print(f"    {name}: {said[:150] or 'ACCEPTED'}")
    print(
        f"M4 FMUs: the twin's process survived {survived} of {total}: one row lost where a row did "
        f"it, refused where it did not start; crash known after {crash:.2f} s at most, hang "
        f"{hang:.2f} s after its limit"
    )
    return survived == total


def packages(root: Path) -> Iterator[tuple[str, Path]]:
    """FMUs that do not even start."""
    import zipfile

    texts_ = {
        "no library for this platform": (description(False, "c", False, True), "win64/mass.dll"),
        "FMI 1": (description(False, "c", False, True).replace('"2.0"', '"1.0"'),
                  "linux64/mass.so"),
        "library that is text": (description(False, "c", False, True), "linux64/mass.so"),
    }  # fmt: skip
    for name, (text, where) in texts_.items():
        file = root / "package.fmu"
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("modelDescription.xml", text)
            archive.writestr(f"binaries/{where}", b"text")
        yield name, file
    yield "crash while it starts", build(root / "load", bad="load")
    file = root / "unit.fmu"
    with zipfile.ZipFile(file, "w") as archive:
        text = description(False, "c", False, True).replace('unit="kg"', 'unit="stone-ish"')
        archive.writestr("modelDescription.xml", text)
        archive.write(library(root, False, ""), "binaries/linux64/mass.so")
    yield "unknown unit", file


def robots() -> bool:
    """M5."""
    named = total = 0
    for name, text, word in corpus.urdfs():
        total += 1
        said = refusal(lambda text=text: urdf.parse(text, "arm.urdf"))  # type: ignore[misc]
        named += word in said
        if word not in said:
            print(f"    {name}: {said or 'ACCEPTED'}")
    opened = [
        name for name, text in corpus.meshes() if name not in " ".join(urdf.parse(text).notes)
    ]
    meshes = len(list(corpus.meshes()))
    print(
        f"M5 URDFs: refused with the element named {named} of {total}; mesh names told and never "
        f"opened {meshes - len(opened)} of {meshes}"
    )
    return named == total and not opened


def diverging(root: Path) -> bool:
    """M6: whole twins over models that blow up; nothing that is not finite may stay anywhere."""
    cases: dict[str, Any] = {
        "stiff, explicit Euler": FunctionModel(
            lambda x, u, dt, p: ([x[0] + dt * (u[0] - p[0] * x[0])],) * 2, Layout.of(u="m/s"),
            Layout.of(x="m"), Layout.of(x="m"), Parameters.of(rate=(1e4, "1/s")),
        ),
        "finite escape": FunctionModel(
            lambda x, u, dt, p: ([x[0] + dt * (u[0] + p[0] * x[0] ** 3)],) * 2,
            Layout.of(u="m/s"), Layout.of(x="m"), Layout.of(x="m"), Parameters.of(k=(1e3, "1")),
        ),
        "root of a negative": FunctionModel(
            lambda x, u, dt, p: ([np.sqrt(x[0] - p[0])],) * 2, Layout.of(u="m/s"),
            Layout.of(x="m"), Layout.of(x="m"), Parameters.of(k=(5.0, "m")),
        ),
        "division by zero": FunctionModel(
            lambda x, u, dt, p: ([u[0] / (u[0] - u[0])],) * 2, Layout.of(u="m/s"),
            Layout.of(x="m"), Layout.of(x="m"), Parameters.of(k=(1.0, "1")),
        ),
        "stiff FMU, Euler": fmu(
            build(root / "stiff"), interface="model-exchange", solver="euler", step=10.0,
            inputs=["force"], outputs=["x"],
        ),
        "FMU asked for too many steps": fmu(
            build(root / "steps"), interface="model-exchange", step=1e-9, outputs=["x"],
        ),
    }  # fmt: skip
    escaped = 0
    rng = np.random.default_rng(0)
    t = np.arange(3000) * 0.1
    for name, model in cases.items():
        drive = model.inputs.names[0]
        data = {"t": t, drive: rng.normal(0, 1, 3000), "x": np.cumsum(rng.normal(0, 0.1, 3000))}
        with np.errstate(all="ignore"), Twin(
            TwinSpec(
                "blow-up", spec.ModelSpec("python"), beat=spec.Span(50),
                prediction=spec.PredictionSpec(horizon=1.0),
                anomaly=spec.AnomalySpec(requirement=0.05, relative=False, window=spec.Span(300)),
            ),
            model,
        ) as twin:  # fmt: skip
            result = twin.run(data)
            stage = twin.setup.track(model)
            state = stage.init()
            for block in twin.blocks(data):
                state, _ = stage.step(state, block)
            values = [v for version in twin.versions for v in version.values]
            text = str(result.to_dict())
        bad = not np.isfinite(values).all() or "nan" in text.lower() or "inf'" in text
        bad = bad or not np.isfinite(state.x).all()
        escaped += bad
        print(f"    {name}: {'NOT FINITE' if bad else 'finite'}, {result.samples} rows")
        if isinstance(model, Fmu):
            model.close()
    print(f"M6 divergence: NaN or infinity escaped {escaped} of {len(cases)}")
    return escaped == 0


def mutated(count: int) -> bool:
    """M7: a valid twin file with one thing wrong is refused with file, line and a reason."""
    rng = random.Random(0)
    files = sorted(Path("twins").glob("*.toml"))
    refused = fine = unclear = broken = 0
    for k in range(count):
        file = files[k % len(files)]
        text = mutation(file.read_text(encoding="utf-8"), rng)
        try:
            reads(text, "twin.toml")
            fine += 1
        except ConfigError as error:
            refused += 1
            clear = str(error).startswith("twin.toml:") and len(str(error)) > 25
            unclear += not clear
            if not clear and unclear <= 5:
                print(f"    unclear: {error}")
        except EvertwinError as error:
            broken += 1
            print(f"    other error: {type(error).__name__}: {error}")
    print(
        f"M7 twin files: {count} mutations of {len(files)} files: still valid {fine}, refused "
        f"{refused}, of these without file and line {unclear}, other errors {broken}"
    )
    return unclear == broken == 0


def mutation(text: str, rng: random.Random) -> str:
    """One thing wrong in a text."""
    lines = text.split("\n")
    told = [k for k, line in enumerate(lines) if "=" in line and not line.startswith("#")]
    k = rng.choice(told)
    key, _, value = lines[k].partition("=")
    kind = rng.randrange(8)
    if kind == 0:  # a letter of the key is lost
        at = rng.randrange(max(len(key.strip()), 1))
        lines[k] = f"{key.strip()[:at]}{key.strip()[at + 1 :]} ={value}"
    elif kind == 1:
        lines[k] = f"{key}x ={value}"
    elif kind == 2:  # another type
        lines[k] = f"{key}= " + rng.choice(["true", "[1, 2]", '"text"', "{ a = 1 }", "-1", "1e400"])
    elif kind == 3:  # another unit
        lines[k] = f"{key}= " + rng.choice(['"3 furlong"', '"1 kg"', '"5 s"', '"x m"', '""'])
    elif kind == 4:  # half written
        return text[: rng.randrange(len(text))]
    elif kind == 5:
        lines.insert(k, lines[k])
    elif kind == 6:
        lines.insert(k, f"[section{rng.randrange(100)}]")
    else:
        at = rng.randrange(len(text))
        return text[:at] + chr(rng.choice([0, 34, 61, 91, 93, 123, 0x20AC])) + text[at + 1 :]
    return "\n".join(lines)


def main(arguments: list[str]) -> int:
    """Exit code 0 if every figure is as it has to be."""
    logging.getLogger("evertwin").setLevel(logging.ERROR)
    count = int(arguments[0]) if arguments else 3000
    watch = Watch()
    results = []
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name) / "temporary"
        scratch.mkdir()
        tempfile.tempdir = str(scratch)
        for k, proof in enumerate((
            archives, lambda r: texts(r, watch), lambda r: pickled(r, watch), misbehaving,
            lambda r: robots(), diverging, lambda r: mutated(count),
        )):  # fmt: skip
            folder = Path(name) / str(k)
            folder.mkdir()
            began = time.perf_counter()
            results.append(proof(folder))
            print(f"    {time.perf_counter() - began:.1f} s")
        left = os.listdir(scratch)
    print(f"bad files: {sum(results)} of {len(results)} held; folders left behind {len(left)}")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
