"""Force that repeats with the screw: sine and cosine of the position, where the rows show it."""

from dataclasses import dataclass

import numpy as np

from .friction_models import FloatArray

_PITCHES_M = 1.0 / np.linspace(1 / 0.03, 1 / 0.003, 120)
_LEAST_GAIN = 9.0
"""Halved relative fall of the squares times rows: with 120 pitches about 1 false find in 100."""
RIPPLE_NAMES = ("ripple_sine", "ripple_cosine")


@dataclass(frozen=True)
class Pitch:
    """A pitch and how much it explains (see `_LEAST_GAIN`)."""

    pitch_m: float
    gain: float


def ripple_columns(start_m: FloatArray, end_m: FloatArray, pitch_m: float) -> list[FloatArray]:
    """Means of sin and cos(2 pi x / pitch) between two positions, passed at even speed."""
    wave = 2 * np.pi / pitch_m
    spread = np.sinc(0.5 * wave * (end_m - start_m) / np.pi)
    middle = 0.5 * wave * (end_m + start_m)
    return [spread * np.sin(middle), spread * np.cos(middle)]


def likeliest_pitch(
    residual: FloatArray, regressor: FloatArray, ripples: list[FloatArray]
) -> Pitch | None:
    """The pitch that explains most of `residual`, if it is more than chance.

    `ripples` holds for each of `searched_pitches_m` the two columns as they enter the regression,
    shape (rows, 2).
    """
    basis, _ = np.linalg.qr(regressor)
    squares = float(residual @ residual)
    best = Pitch(0.0, 0.0)
    for pitch_m, columns in zip(_PITCHES_M.tolist(), ripples, strict=True):
        own = columns - basis @ (basis.T @ columns)
        explained = residual @ own @ np.linalg.lstsq(own, residual, rcond=None)[0]
        gain = 0.5 * len(residual) * float(explained) / (squares - float(explained))
        if gain > best.gain:
            best = Pitch(pitch_m, gain)
    return best if best.gain > _LEAST_GAIN else None


def searched_pitches_m() -> list[float]:
    """From 30 to 3 mm, evenly in waves per metre."""
    values: list[float] = _PITCHES_M.tolist()
    return values
