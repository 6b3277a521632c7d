"""Places where the bead leaves its band, and the channel that moved there."""

import numpy as np
import pytest

from seamlog.analysis.excursions import (
    find_excursions,
    lagged_correlation,
    rank_causes,
    usual_band,
)

S_MM = np.arange(0.0, 200.0, 0.25)
RNG = np.random.default_rng(4)


def bump(at_mm: float, length_mm: float) -> np.ndarray:
    return np.exp(-0.5 * ((S_MM - at_mm) / length_mm) ** 2)


def rough(size: float) -> np.ndarray:
    return size * RNG.standard_normal(len(S_MM))


def test_an_even_bead_has_no_excursion() -> None:
    width = 6 + rough(0.03)
    assert find_excursions(S_MM, width, 0.0, usual_band(width, None, None)) == []


def test_excursions_are_found_on_both_sides_with_gaps_between() -> None:
    width = 6 + rough(0.03) + 1.5 * bump(120, 3) - 1.2 * bump(50, 3)
    width[300:304] = np.nan
    narrow, wide = find_excursions(S_MM, width, 0.0, usual_band(width, None, None))
    assert narrow.s_mm == pytest.approx(50, abs=1)
    assert wide.s_mm == pytest.approx(120, abs=1)
    assert wide.peak_width_mm == pytest.approx(7.5, abs=0.1)
    assert narrow.peak_width_mm == pytest.approx(4.8, abs=0.1)


def test_limits_of_the_user_make_the_band() -> None:
    width = 6 + 0.5 * bump(80, 20)
    assert find_excursions(S_MM, width, 0.0, usual_band(width, 5.0, 7.0)) == []
    found = find_excursions(S_MM, width, 0.0, usual_band(width, None, 6.3))
    assert [round(item.s_mm) for item in found] == [80]


def test_the_channel_that_moved_leads_the_ranking() -> None:
    dip = bump(120, 4)
    width = 6 + rough(0.05) + 1.5 * dip
    channels = {
        "weld_speed": 6 + rough(0.05) - 2.4 * dip,
        "tracking_error": 0.2 + rough(0.05),
        "command": 5 * np.sin(S_MM / 15) + rough(0.1),
        "current": 180 + rough(2.0),
    }
    (place,) = find_excursions(S_MM, width, 0.0, usual_band(width, None, None))
    first, second, *_ = rank_causes(place, width, channels, {})
    assert first.channel == "weld_speed"
    assert first.moved
    assert first.weight > 5 * second.weight
    assert first.there < 5 < first.usual


def test_no_channel_is_blamed_when_none_moved() -> None:
    width = 6 + rough(0.05) + 1.5 * bump(120, 4)
    channels = {"weld_speed": 6 + rough(0.05), "current": 180 + rough(2.0)}
    (place,) = find_excursions(S_MM, width, 0.0, usual_band(width, None, None))
    assert not any(cause.moved for cause in rank_causes(place, width, channels, {}))


def test_channels_that_were_not_logged_are_left_out() -> None:
    width = 6 + rough(0.05) + 1.5 * bump(120, 4)
    (place,) = find_excursions(S_MM, width, 0.0, usual_band(width, None, None))
    assert rank_causes(place, width, {"current": np.full(len(S_MM), np.nan)}, {}) == []


def test_lag_of_the_width_behind_the_channel() -> None:
    channel = np.convolve(RNG.standard_normal(len(S_MM) + 60), np.ones(21) / 21, mode="same")
    found = lagged_correlation(S_MM, 6 - channel[18:818], channel[30:830])
    assert found is not None
    r, lag_mm = found
    assert r == pytest.approx(-1, abs=0.02)
    assert lag_mm == pytest.approx(3.0, abs=0.3)
    assert lagged_correlation(S_MM, np.full(len(S_MM), 6.0), channel[:800]) is None


def test_what_its_uncertainty_explains_is_no_excursion() -> None:
    width = np.full(len(S_MM), 6.0)
    width[200:240] = 6.5
    band = usual_band(width, None, 6.3)
    assert len(find_excursions(S_MM, width, 0.09, band)) == 1
    assert find_excursions(S_MM, width, 0.11, band) == []
