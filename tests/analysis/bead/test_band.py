"""The band as a whole and chains of places: against all that could be, and against numpy."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from seamlog.analysis.bead.band import BandSearch, edge_evidence
from seamlog.analysis.bead.chain import best_chains
from seamlog.analysis.bead.features import in_spreads, quantiles

Floats = NDArray[np.float32]
SECTIONS, COLUMNS = 24, 120


def features(*bands: tuple[float, int, int]) -> Floats:
    """Sections of noise with bands (lightness, first column, last), as lightness and texture."""
    picture = np.random.default_rng(1).normal(0, 1.0, (SECTIONS, COLUMNS, 2)).astype(np.float32)
    for lightness, first, last in bands:
        picture[:, first:last, 0] += lightness
    return picture


@given(
    arrays(
        np.int8, st.tuples(st.just(2), st.integers(1, 6), st.just(3)), elements=st.integers(-9, 9)
    )
)
def test_chains_gather_the_most_of_all_chains(scores: NDArray[np.int8]) -> None:
    def gathered(score: NDArray[np.int8], path: tuple[int, ...]) -> float:
        moves = np.abs(np.diff(path))
        if moves.max(initial=0) > 1:
            return -np.inf
        return float(score[np.arange(len(score)), path].sum() - 0.25 * moves.sum())

    chains = best_chains(scores.astype(np.float32), 0.25)
    for score, chain in zip(scores, chains, strict=True):
        paths = itertools.product(range(3), repeat=len(score))
        most = max(gathered(score, path) for path in paths)
        assert gathered(score, tuple(chain.tolist())) == pytest.approx(most)


def test_a_chain_keeps_away_from_forbidden_places() -> None:
    score = np.zeros((1, 7, 5), dtype=np.float32)
    score[0, :, 2] = 9
    score[0, 3, 1:] = -np.inf
    assert best_chains(score, 0.1)[0].tolist() == [2, 2, 1, 0, 1, 2, 2]


@given(
    st.lists(st.floats(-1e3, 1e3, width=32), min_size=1, max_size=60), st.sampled_from([0.01, 0.16])
)
def test_quantiles_are_numpys(values: list[float], share: float) -> None:
    found = quantiles(np.array(values, dtype=np.float32), share)
    assert found == pytest.approx(np.quantile(values, [share, 1 - share]), abs=1e-3)


def test_quantiles_of_many_come_near_those_of_all() -> None:
    values = np.random.default_rng(2).standard_normal(100_000).astype(np.float32)
    assert quantiles(values, 0.16) == pytest.approx((-0.994, 0.994), abs=0.05)


def test_the_most_evident_band_is_found_with_its_edges() -> None:
    band = BandSearch(features((60, 40, 64), (20, 90, 100)), 3.0, 70.0).best()
    assert band is not None
    assert (band.first, band.last) == (0, SECTIONS - 1)
    assert np.median(band.left) == pytest.approx(40, abs=1.5)
    assert np.median(band.right) == pytest.approx(64, abs=1.5)


def test_a_band_that_holds_the_given_column_is_found_beside_a_more_evident_one() -> None:
    search = BandSearch(features((60, 20, 44), (20, 84, 96)), 3.0, 70.0, held=(90.0, 4.0))
    band = search.best()
    assert band is not None
    assert np.median(band.left) == pytest.approx(84, abs=1.5)
    assert np.median(band.right) == pytest.approx(96, abs=1.5)


def test_a_band_ends_where_it_ends() -> None:
    picture = features()
    picture[6:18, 50:70, 0] += 60
    band = BandSearch(picture, 3.0, 70.0).best()
    assert band is not None
    assert (band.first, band.last) == (6, 17)


def test_no_band_in_noise() -> None:
    assert BandSearch(features(), 3.0, 70.0).best() is None


def test_edges_are_sharp_where_a_band_begins_and_nowhere_else() -> None:
    planes = in_spreads(np.moveaxis(features((60, 50, 70)), 2, 0))
    evidence = np.median(edge_evidence(planes, 4), axis=0)
    assert evidence.shape == (COLUMNS + 1,)
    assert sorted(np.argsort(evidence)[-2:].tolist()) == [50, 70]
    assert evidence[[20, 60, 100]].max() < 0.5 * evidence[[50, 70]].min()
