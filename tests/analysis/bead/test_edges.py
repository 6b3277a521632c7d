"""Placing a toe below a pixel: profiles whose edge is known."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from seamlog.analysis.bead.edge_model import choose_model, typical_blur
from seamlog.analysis.bead.edge_places import locate_edges
from seamlog.analysis.bead.edge_shapes import Window, basis, even_ruler, step_at
from seamlog.analysis.bead.refine import averaged_at

WINDOW = Window(18, 18)
COLUMNS, MIDDLE, ROWS = 61, 30, 300
Floats = NDArray[np.float64]


def toes(seed: int = 0) -> Floats:
    """Columns of a toe that wanders slowly."""
    wander = gaussian_filter1d(np.random.default_rng(seed).standard_normal(ROWS), 20.0, mode="wrap")
    return np.asarray(MIDDLE + 0.6 * wander / wander.std())


def picture(toe: Floats, model: str = "step", parts: tuple[float, ...] = ()) -> Floats:
    """Rows of a step of 80 grey levels with a blur of 1.1, and what lies beside it."""
    z = np.arange(COLUMNS) - toe[:, None]
    return np.asarray(basis(z, model, 1.1) @ np.array([90.0, 80.0, *parts]))


def located(signal: Floats, toe: Floats) -> tuple[Floats, Floats, str]:
    near, signal32 = np.rint(toe), signal.astype(np.float32)
    model = choose_model(signal32, near.astype(np.int64), WINDOW)
    places = locate_edges(signal32, near, model)
    return places.column - toe, np.hypot(places.u_noise, places.u_model), model.name


def placed_evenly(signal: Floats) -> Floats:
    """Columns of the toe by a plain step among noise that is taken to be even."""
    found = even_ruler(WINDOW, 1.1, 2.5).places(signal[:, MIDDLE - 18 : MIDDLE + 19])
    return MIDDLE + found.shift


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("noise", [1.0, 4.0, 12.0])
def test_noise_moves_a_step_by_as_much_as_is_said(noise: float) -> None:
    toe = toes()
    seen = picture(toe) + np.random.default_rng(1).normal(0, noise, (ROWS, COLUMNS))
    error, u, _ = located(seen, toe)
    limit = noise / 80 * np.sqrt(2 * np.sqrt(np.pi) * 1.1)
    assert rms(error) < 1.25 * limit
    assert 0.9 <= np.mean(np.abs(error) <= 1.96 * u) <= 0.99


@pytest.mark.parametrize(
    ("model", "parts"),
    [("line", (-35.0,)), ("broad line", (-30.0,)), ("ramps", (-3.0, 0.8))],
)
def test_what_lies_beside_a_step_does_not_move_it(model: str, parts: tuple[float, ...]) -> None:
    toe = toes()
    seen = picture(toe, model, parts) + np.random.default_rng(1).normal(0, 1, (ROWS, COLUMNS))
    error, u, _ = located(seen, toe)
    plain = placed_evenly(seen) - toe
    assert abs(np.median(error)) < 0.25 * abs(np.median(plain))
    assert abs(np.median(error)) < 2 * np.median(u)


def test_the_ripple_of_a_bead_moves_its_toe_less_than_an_even_fit_says() -> None:
    toe = toes()
    rng = np.random.default_rng(2)
    ripple = gaussian_filter1d(rng.standard_normal((ROWS, COLUMNS)), 1.5, axis=1)
    inside = step_at(np.arange(COLUMNS) - toe[:, None], 1.1)
    seen = picture(toe) + inside * 10 * ripple / ripple.std() + rng.normal(0, 1, (ROWS, COLUMNS))
    error, u, _ = located(seen, toe)
    even = placed_evenly(seen) - toe
    assert np.std(error) < 0.6 * np.std(even)
    assert np.mean(np.abs(error) <= 1.96 * u) >= 0.85


def test_a_step_is_not_taken_for_something_richer() -> None:
    toe = toes()
    seen = picture(toe) + np.random.default_rng(3).normal(0, 4, (ROWS, COLUMNS))
    assert located(seen, toe)[2] == "step"


def test_a_rise_is_found_beside_a_higher_fall() -> None:
    toe = np.full(ROWS, float(MIDDLE))
    z = np.arange(COLUMNS) - toe[:, None]
    seen = 90 + 40 * step_at(z, 1.1) - 120 * step_at(z - 12, 1.1)
    found = even_ruler(Window(8, 8), 1.1, 2.5).places(seen[:, MIDDLE - 8 : MIDDLE + 9])
    assert found.shift == pytest.approx(0.0, abs=0.4)


def test_a_ragged_toe_is_as_sharp_as_its_rows() -> None:
    toe = MIDDLE + np.random.default_rng(4).normal(0, 1.2, ROWS)
    rows = picture(toe)[:, MIDDLE - 18 : MIDDLE + 19]
    assert typical_blur(rows, WINDOW) == pytest.approx(1.1, rel=0.2)


def test_rows_are_averaged_as_by_scipy() -> None:
    values = np.random.default_rng(5).random((80, 7)).astype(np.float32)
    rows = np.array([0, 3, 40, 79])
    expected = gaussian_filter1d(values, 4.0, axis=0, mode="nearest", truncate=3.0)
    assert averaged_at(values, rows, 4.0) == pytest.approx(expected[rows], abs=1e-5)
