"""The bead measured with its loops as machine code is the bead measured without, to the bit."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seamlog.analysis.bead.assess import assess_photos
from seamlog.analysis.bead.band import BandSearch
from seamlog.analysis.bead.chain import best_chains
from seamlog.analysis.bead.edge_model import moved, profiles_at
from seamlog.analysis.bead.edge_shapes import Window, peak
from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.loops import as_machine_code, chains, loaded
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.sources import PhotoSource
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, SyntheticBead, render

SEEDS = st.integers(0, 2**32 - 1)
SCENES = {
    "plain": Scene(width_px=640, height_px=360, noise=2),
    "seen aslant, with glare": Scene(
        width_px=640, height_px=360, noise=3, specular=1, perspective=1, texture=6
    ),
    "a dark toe in a tint": Scene(
        width_px=640, height_px=360, noise=3, dark_toe=25, haz=30, ripple=10
    ),
}


@pytest.fixture(autouse=True)
def numba() -> None:
    pytest.importorskip("numba")


def measured(bead: SyntheticBead, along_path: bool, colour: bool) -> BeadMeasurement:
    pixels = bead.pixels
    if colour:
        pixels = np.rint(pixels[..., None] * np.array([1.0, 0.9, 0.8])).astype(np.uint8)
    photo = make_photo(pixels, "photo")
    plane = plane_of(photo, bead.calibration)
    return measure_strip(photo, plane, bead.wandering_path(seed=1) if along_path else None)


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("along_path", [False, True])
@pytest.mark.parametrize("title", SCENES)
def test_the_same_bead(title: str, along_path: bool, colour: bool) -> None:
    bead = render(SCENES[title], 3)
    plain = measured(bead, along_path, colour)
    with as_machine_code():
        compiled = measured(bead, along_path, colour)
    assert compiled.confidence == plain.confidence
    for name in ("s", "width", "u_width", "left_px", "right_px", "flagged"):
        ours, theirs = getattr(compiled, name), getattr(plain, name)
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f"), name


def both(act: Callable[..., Any], *given: Any) -> tuple[Any, Any]:
    plain = act(*given)
    with as_machine_code():
        return plain, act(*given)


@given(SEEDS)
def test_the_same_chains_where_places_are_alike(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, rows, columns = rng.integers([1, 1, 3], [3, 30, 25])
    score = (rng.integers(0, 4, (count, rows, columns)) / 4).astype(np.float32)
    score[rng.random(score.shape) < 0.2] = -1e6
    plain, compiled = both(best_chains, score, 0.25)
    assert np.array_equal(plain, compiled)


@given(SEEDS, st.sampled_from([1, 2]))
def test_the_same_band(seed: int, slope: int) -> None:
    rng = np.random.default_rng(seed)
    features = rng.standard_normal((rng.integers(3, 20), 40, rng.integers(2, 5)))
    features[:, 12:22, 0] += rng.integers(0, 8)

    def searched() -> tuple[Any, ...] | None:
        band = BandSearch(features.astype(np.float32), 3.0, 25.0, slope).best()
        if band is None:
            return None
        edges = band.left.tolist(), band.right.tolist(), band.evidence.tolist()
        return band.first, band.last, edges, band.total

    plain, compiled = both(searched)
    assert plain == compiled


@given(SEEDS)
def test_the_same_profiles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(1, 30))
    signal = rng.standard_normal((rows, 40)).astype(np.float32)
    centre, shift = rng.integers(-5, 45, rows), rng.normal(0, 4, rows)
    for plain, compiled in (
        both(profiles_at, signal, centre, Window(8, 6)),
        both(moved, signal, shift),
        both(peak, np.round(signal, 1), np.arange(40.0)),
    ):
        assert np.array_equal(plain, compiled)


@pytest.mark.parametrize("many", [2, 3])
def test_many_photos_are_measured_by_machine_code(
    monkeypatch: pytest.MonkeyPatch, many: int
) -> None:
    used = set()

    def detector(*given: Any, **options: Any) -> BeadMeasurement:
        used.add(loaded(chains) is not None)
        return measure_strip(*given, **options)

    monkeypatch.setattr("seamlog.analysis.bead.assess.MANY", many)
    monkeypatch.setattr("seamlog.analysis.bead.part.load", lambda *_: detector)
    bead = render(SCENES["plain"], 3)
    assess_photos([PhotoSource(make_photo(bead.pixels, each), None, ()) for each in "ab"])
    assert used == {many == 2}


def test_machine_code_is_used_within_its_block_only(monkeypatch: pytest.MonkeyPatch) -> None:
    assert loaded(chains) is None
    with as_machine_code():
        assert loaded(chains) is not None
        with as_machine_code():
            pass
        assert loaded(chains) is not None
    assert loaded(chains) is None
    monkeypatch.setattr("seamlog.analysis.bead.loops.machine_code", lambda _: None)
    with as_machine_code():
        assert loaded(chains) is None
