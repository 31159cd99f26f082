"""The past by pixel is what the store holds, and nothing where nothing is."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from evertwin.config import TwinSpec
from evertwin.config.spec import ModelSpec
from evertwin.errors import UsageError
from evertwin.fold import Chunk
from evertwin.service.twin.live_twin import shown
from evertwin.service.views.history import (
    PIECES,
    Span,
    Stored,
    looked_back,
    of_rows,
    of_samples,
    pixels,
)
from evertwin.sources.spec import ChannelSpec, SourceSpec, TimeSpec
from evertwin.store import Batch, SqliteStore
from evertwin.twin import Twin

LOG = SourceSpec("log", {"v": ChannelSpec("v", "m/s"), "x": ChannelSpec("x", "m")},
                 time=TimeSpec("t"))  # fmt: skip


def brute(t: np.ndarray, v: np.ndarray, first: int, last: int, width: int) -> dict[int, tuple]:  # type: ignore[type-arg]
    """Pixel → least and largest, in whole numbers of Python."""
    found: dict[int, tuple[float, float]] = {}
    for stamp, value in zip(t.tolist(), v.tolist()):
        if first <= stamp <= last and np.isfinite(value):
            pixel = next(
                k for k in range(width) if k == width - 1
                or stamp < first + (k + 1) * (last - first) // width
            )  # fmt: skip
            low, high = found.get(pixel, (value, value))
            found[pixel] = min(low, value), max(high, value)
    return found


def test_pixels_are_those_counted_one_by_one() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        t = np.sort(rng.integers(0, 10**18, 400))
        v = np.where(rng.random(400) < 0.2, np.nan, rng.normal(size=400))
        first, last = sorted(int(k) for k in rng.integers(0, 10**18, 2))
        width = int(rng.integers(1, 40))
        got = pixels(Span(first, last, width), t, v)
        told = dict(zip(got["pixel"], zip(got["low"], got["high"])))
        assert told == brute(t, v, first, last, width)


@pytest.fixture
def kept() -> Any:
    """What a runner has of 10⁵ stored samples, of which every tenth is absent."""
    rng, store = np.random.default_rng(2), SqliteStore(":memory:")
    t = np.cumsum(rng.integers(1, 2 * 10**9, 100_000))
    v = rng.normal(size=(100_000, 2))
    v[::10, 1] = np.nan
    store.commit(
        Batch(chunks=[Chunk("log", t[k : k + 50], v[k : k + 50]) for k in range(0, len(t), 50)])
    )
    return SimpleNamespace(stored=Stored(store, (LOG,)), t=t, v=v)


def test_what_is_shown_is_what_is_stored(kept: Any) -> None:
    t, x, rng = kept.t, kept.v[:, 1], np.random.default_rng(3)
    for width in (1, 317, 1280):
        first, last = sorted(int(k) for k in rng.choice(t, 2, replace=False))
        span = Span(first, last, width)
        shown = of_samples(kept.stored, span, "x")
        assert shown is not None
        edges = [first + k * (last - first) // width for k in range(1, width)]
        at = np.searchsorted(np.array(edges, dtype=np.int64), t, side="right")
        inside = (t >= first) & (t <= last) & np.isfinite(x)
        assert shown["pixel"] == sorted(set(at[inside].tolist()))
        for pixel, low, high in zip(shown["pixel"], shown["low"], shown["high"]):
            there = x[inside & (at == pixel)]
            assert (low, high) == (there.min(), there.max())


def test_what_is_derived_or_too_much_comes_from_the_rows(kept: Any) -> None:
    assert of_samples(kept.stored, Span(0, int(kept.t[-1]), 10), "heading") is None
    one = [Chunk("log", kept.t[-1:] + k + 1, kept.v[:1]) for k in range(PIECES + 1)]
    kept.stored.store.commit(Batch(chunks=one))
    assert of_samples(kept.stored, Span(int(kept.t[-1]), 2**62, 10), "x") is None


def test_rows_of_a_span_are_those_of_the_run() -> None:
    with Twin(TwinSpec("cart", ModelSpec("robot1d"), source=(LOG,))) as twin:
        t = np.arange(6000) * 10**8
        x = np.where(np.arange(6000) % 2000 < 50, np.nan, 0.01 * np.arange(6000))
        samples = np.column_stack([np.full(6000, 0.1), x])
        for k in range(0, 6000, 7):
            twin.push(Chunk("log", t[k : k + 7], samples[k : k + 7]))
        view = twin.going().between(int(t[100]), int(t[5500]))
        assert view.t.tolist() == t[100:5501].tolist()
        newest = twin.view(5000)
        assert newest.t.tolist() == t[1000:].tolist()
        absent = Stored(twin.store, ())  # type: ignore[arg-type]
        told = looked_back(absent, view, twin.model, Span(int(t[100]), int(t[5500]), 54), ("x",))
        shown = told["signals"]["x"]
        assert not shown["stored"]
        gaps = set(range(54)) - set(shown["measured"]["pixel"])
        assert gaps == set() and shown["predicted"]["pixel"] == list(range(54))
        fine = looked_back(absent, view, twin.model, Span(int(t[1990]), int(t[2090]), 100), ("x",))
        assert set(range(11, 59)).isdisjoint(fine["signals"]["x"]["measured"]["pixel"])


def test_a_span_that_ends_before_it_begins_is_refused() -> None:
    with pytest.raises(UsageError, match="first, last"):
        Span.of(2.0, 1.0, 100)


def test_angles_are_shown_in_the_turn_of_what_is_measured() -> None:
    """A heading that was integrated over two turns lies beside the measured one."""
    with Twin(TwinSpec("base", ModelSpec("differential"))) as twin:
        t, names = 0.1 * np.arange(300), ("x", "y", "heading")
        none = {"x": np.full(300, np.nan), "y": np.full(300, np.nan)}
        heading = np.pi - np.mod(np.pi - 0.5 * np.maximum(t - 0.1, 0.0), 2 * np.pi)
        twin.push({"t": t, "v": np.zeros(300), "w": np.full(300, 0.5), "heading": heading, **none})
        view, model = twin.view(300), twin.model
    assert np.nanmax(view.predicted[:, 2]) > 7.0
    told = shown(view, model, np.arange(300))["outputs"]["heading"]
    pairs = zip(told["predicted"], told["measured"], strict=True)
    assert max(abs(p - m) for p, m in pairs if p is not None) < 0.5
    span = Span(int(view.t[0]), int(view.t[-1]) + 1, 100)
    past = of_rows(view, model, span, names)["heading"]["predicted"]
    assert max(past["high"]) < 4.0
