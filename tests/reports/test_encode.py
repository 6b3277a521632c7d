"""Columns on their way into the page: nothing that can be seen gets lost."""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as st_np
from numpy.typing import NDArray

from seamlog.reports.encode import decode, encode
from tests.browsing import Visitor

Floats = NDArray[np.float64]
columns = st_np.arrays(
    np.float64,
    st.integers(0, 300),
    elements=st.one_of(
        st.floats(-1e6, 1e6, width=32), st.just(np.nan), st.just(np.inf), st.just(-np.inf)
    ),
)


def assert_same(found: Floats, given_: Floats) -> None:
    """Gaps where nothing was finite, else equal to well below what a screen can show."""
    known = np.isfinite(given_)
    assert np.array_equal(np.isfinite(found), known)
    if known.any():
        span = float(np.ptp(given_[known])) or abs(float(given_[known][0]))
        assert np.all(np.abs(found - given_)[known] <= span / 20_000 + 1e-300)


@given(columns)
@settings(deadline=None)
def test_round_trip(column: Floats) -> None:
    assert_same(decode(encode(column)), column)


@given(
    st_np.arrays(np.int64, st.integers(1, 300), elements=st.integers(-(10**8), 10**8)),
    st.integers(0, 4),
)
@settings(deadline=None)
def test_values_at_a_sensors_resolution_come_back_exactly(
    ticks: NDArray[np.int64], decimals: int
) -> None:
    column = ticks / 10**decimals
    assert np.array_equal(decode(encode(column)), column)


def test_large_offsets_and_extreme_ticks() -> None:
    column = 1.7e9 + np.arange(1000) / 1000
    assert np.array_equal(decode(encode(column)), column)
    jumps = np.array([-(2.0**31) + 2, 2.0**31 - 2] * 5)
    assert_same(decode(encode(jumps)), jumps)


def test_small_motion_beside_a_spike_keeps_its_shape() -> None:
    column = 1e-3 * np.sin(np.arange(5000) / 7 + 0.123)
    column[2500] = 5.0
    found = decode(encode(column))
    assert np.max(np.abs(found - column)) < 1e-3 / 20


def test_size_of_the_bench_signal() -> None:
    t = np.arange(100_000) / 1000
    random = np.random.default_rng(0)
    y = 2 * np.sin(0.6 * t) + 0.2 * random.normal(size=t.size) + 0.3 * np.sin(14 * np.pi * t)
    assert len(encode(t).data) < 2_000
    assert len(encode(np.round(y, 3)).data) < 200_000


def test_the_browser_decodes_what_python_encodes(visitor: Visitor, tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    gaps = np.where(random.random(500) < 0.2, np.nan, random.normal(size=500))
    given_ = [
        np.arange(500) / 25,
        np.round(random.normal(0, 3, 500), 3),
        gaps,
        1e6 + 1e-3 * random.normal(size=500),
        np.full(500, -7.25),
        1e-7 * random.normal(size=500),
    ]
    blank = tmp_path / "blank.html"
    blank.write_text("<!doctype html><html data-state='blank'><title>blank</title></html>")
    coded = [encode(column).model_dump(exclude_none=True) for column in given_]
    decoder = files("seamlog.reports").joinpath("assets", "decode.js").read_text()
    script = f"async columns => {{ {decoder}; return JSON.stringify({ALL}); }}"
    found = json.loads(visitor.open(blank).page.evaluate(script, coded))
    for column, decoded in zip(given_, found, strict=True):
        assert_same(np.array([np.nan if v is None else v for v in decoded]), column)


ALL = "await Promise.all(columns.map(async column => Array.from(await decodeColumn(column))))"
