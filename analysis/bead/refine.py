"""From coarse toes to sub-pixel ones, in windows along each toe at the photo's own resolution."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from seamlog.errors import EvidenceError

from .chain import best_chain
from .curve import Centreline
from .edge_model import EdgeModel, choose_model, profiles_at, typical_blur
from .edge_places import EdgePlaces, locate_edges, random_u, ruler_for, shading_along
from .edge_shapes import Fit, Window
from .image import Photo
from .plane import Plane
from .sampling import sample_rows
from .width import Toes
from .zones import fisher_direction

Floats = NDArray[np.float64]
Signal = NDArray[np.float32]
Rows = NDArray[np.int64]

_ALONG_PX = 4.0
_ALONG_WIDTHS = 0.03
"""Gaussian averaging along the seam: this many px at most, or this part of the width if more."""
_SHARES = (1.0, 0.65, 0.42, 0.27, 0.18)
"""Parts of the longest averaging that are tried."""
_CALM = 1.5
"""Windows follow the coarse toe averaged over this many longest averagings: what they average
must lie along a straight line."""
_WINDOW_PX = 18
_SEARCHED = 0.08
"""Half widths around the coarse toe in which the sharpest edge is looked for."""
_MODEL_ROWS = 512
"""Rows from which a toe's model is made at most, and from which the averaging along it is."""
_TRIED_ROWS = 160
_GOLDEN = (np.sqrt(5) - 1) / 2
_SENSOR_PX = 0.02
"""Noise that the place of any edge has by the pixels' raster, at the shortest averaging."""
_RASTER_PX = 0.02
"""Standard uncertainty that the raster and the unknown shape of the blur leave at the longest."""
_SHARP_PX = 2.0
"""Blur up to which a toe is not looked at twice."""
_MOST_SMEARED = 2.5
"""Waviness that was lost, in parts of what one more smoothing takes, at most."""
_ENOUGH = 64


@dataclass(frozen=True, slots=True)
class Rough:
    """Coarse toes per row of a line: offsets in the plane's unit, and how bead-like the inside."""

    left: Floats
    right: Floats
    present: Floats

    @property
    def half(self) -> float:
        """Typical half width."""
        return float(np.median(self.right - self.left)) / 2


def longest_px(half_px: float) -> float:
    """The longest averaging along a toe that is tried (Gaussian sigma)."""
    return max(_ALONG_PX, 2 * _ALONG_WIDTHS * half_px)


def refine_toes(
    photo: Photo, plane: Plane, line: Centreline, rough: Rough, unit: float, every: int
) -> tuple[Toes, Toes]:
    """Sub-pixel toes of both sides at each `every`-th row of `line`; `unit` is a px's length."""
    left = _Side(photo, plane, line, rough.left, -1, rough, unit).refined(every)
    return left, _Side(photo, plane, line, rough.right, 1, rough, unit).refined(every)


class _Side:
    """One toe: its windows, the bead to the right, as the mixture of colours that tells most."""

    def __init__(
        self,
        photo: Photo,
        plane: Plane,
        line: Centreline,
        toe: Floats,
        side: int,
        rough: Rough,
        unit: float,
    ) -> None:
        half_px, row_px = rough.half / unit, float(line.s[1] - line.s[0]) / unit
        self._longest = longest_px(half_px) / row_px
        toe = gaussian_filter1d(toe, _CALM * self._longest, mode="nearest")
        self._rough, self._toe, self._side, self._unit = rough, toe, side, unit
        self._row_px = row_px
        self._search = 3 + _SEARCHED * half_px
        inside = max(3, min(_WINDOW_PX, int(0.8 * half_px)))
        self._window = Window(_WINDOW_PX, inside)
        self._reach = _WINDOW_PX + int(np.ceil(self._search)) + 3
        step = -side * unit
        first = toe - self._reach * step
        pixels, self._valid = sample_rows(photo, plane, line, first, step, 2 * self._reach + 1)
        depth = int(max(4, min(0.25 * half_px, self._reach)))
        direction, self._distance = self._direction(pixels, depth)
        self._signal = _mixed(pixels, direction)

    def _direction(self, pixels: Signal, depth: int) -> tuple[Floats, float]:
        rows = _tried(len(pixels), _TRIED_ROWS)
        smooth, valid = averaged_at(pixels, rows, self._longest), self._valid[rows]
        groups = []
        for first in (self._reach + 1, self._reach - depth + 1):
            part = slice(first, first + depth - 1)
            groups.append(smooth[:, part][valid[:, part]])
        if min(len(group) for group in groups) < _ENOUGH:
            raise EvidenceError(
                "the plate beside the bead is not in the photo, so its toe cannot be told; "
                "take the photo with plate on both sides"
            )
        return fisher_direction(*groups)

    def refined(self, every: int) -> Toes:
        """The toe at each `every`-th row."""
        pick = np.arange(every // 2, len(self._toe), every)
        signal = averaged_at(self._signal, pick, self._longest)
        near = self._sharpest(signal)
        model = self._model(signal, near)
        share = self._averaging(pick, near, model)
        if share < 1:
            signal = averaged_at(self._signal, pick, share * self._longest)
        places = locate_edges(signal, near, model)
        smeared = self._smeared(places, share, every) if share < 1 else 0.0
        return self._toes(places, smeared, share, pick, self._softness(signal, near, model))

    def _softness(self, signal: Signal, near: Floats, model: EdgeModel) -> float:
        """Blur of the toe; that of single rows where their mean is soft, for a toe is ragged."""
        if model.blur <= _SHARP_PX:
            return model.blur
        rows = _tried(len(near), _TRIED_ROWS)
        profiles = profiles_at(signal[rows], np.rint(near[rows]).astype(np.int64), self._window)
        return typical_blur(profiles, self._window)

    def _smeared(self, places: EdgePlaces, share: float, every: int) -> float:
        """Px of the toe's own waviness that blur and averaging take away, rms.

        One more smoothing takes less than they did, by as much as yet another one takes less
        than it. Giving it back by deconvolution was tried: on a textured plate it amplifies more
        noise than it restores.
        """
        averaged = share * self._longest
        sigma = np.hypot(places.blur_px / self._row_px, averaged)
        taken = places.column - _slow(places.column, sigma / every)
        again = _slow(taken, sigma / every)
        wide, noise = (sigma / averaged) ** 2, float(np.median(places.u_noise)) ** 2
        first = float(np.var(taken)) - noise * _passed(0, wide)
        second = float(np.var(again)) - noise * _passed(1, wide)
        if first <= 0 or second <= 0:
            return 0.0
        return float(np.sqrt(first * np.clip(first / second, 1.0, _MOST_SMEARED**2)))

    def _sharpest(self, signal: Signal) -> Floats:
        """Chain of the steepest rises from plate to bead near the coarse toe."""
        smooth = cv2.GaussianBlur(signal, (0, 0), sigmaX=1.5, sigmaY=1.0)[::2]
        rise = np.gradient(smooth, axis=1)
        inward = np.abs(np.arange(signal.shape[1]) - self._reach)
        near = inward <= self._search
        typical = np.median(np.where(near, rise, 0).max(axis=1)) + 1e-6
        score = np.where(near, np.clip(rise / typical, 0, 1.5), -1e6).astype(np.float32)
        rows = np.arange(len(signal))
        return np.interp(rows, rows[::2], best_chain(score, 0.1))

    def _model(self, signal: Signal, near: Floats) -> EdgeModel:
        rows = _tried(len(near), _MODEL_ROWS)
        return choose_model(signal[rows], np.rint(near[rows]).astype(np.int64), self._window)

    def _averaging(self, pick: Rows, near: Floats, model: EdgeModel) -> float:
        """Part of the longest averaging with the least expected error (Stein's estimate)."""
        rows = _tried(len(near), _TRIED_ROWS)
        pick, centre = pick[rows], np.rint(near[rows]).astype(np.int64)
        found: list[Fit] = []
        sigmas = [share * self._longest for share in _SHARES]
        for signal in averages_at(self._signal, pick, sigmas):
            seen = profiles_at(signal, centre, model.window)
            if not found:
                shading = shading_along(seen, centre, model)
            found.append(ruler_for(seen - shading, model).places(seen - shading))
        places = np.array([centre + one.shift for one in found])
        noise = float(np.median(random_u(found[-1], model.window))) ** 2
        return _least_risk(places, np.array(_SHARES), noise)

    def _toes(
        self, places: EdgePlaces, smeared: float, share: float, pick: Rows, soft_px: float
    ) -> Toes:
        column = places.column
        rows = np.arange(len(column))
        beyond = column - 3 - 2 * places.blur_px
        outside = np.clip(np.rint(beyond).astype(int), 0, 2 * self._reach)
        inward = column - self._reach
        toe = self._toe.astype(np.float32)[:, None]
        followed = averaged_at(toe, pick, share * self._longest)[:, 0]
        return Toes(
            offset=followed.astype(np.float64) - self._side * self._unit * inward,
            u_noise=places.u_noise * self._unit,
            u_model=np.hypot(places.u_model, _RASTER_PX) * self._unit,
            smeared=smeared * self._unit,
            height=places.height,
            bare=places.bare,
            within=places.within,
            in_frame=self._valid[pick][rows, outside],
            present=self._rough.present[pick],
            disagreement=np.abs(inward) * self._unit,
            distance=self._distance,
            blur_px=soft_px,
        )


def _tried(count: int, most: int) -> Rows:
    """Rows to try things on, spread unevenly: a ripple must not keep step with them."""
    if count <= most:
        return np.arange(count)
    at = np.arange(most)
    return np.asarray((at + at * _GOLDEN % 1.0) * count / most, dtype=np.int64)


def _slow(values: Floats, sigma: float) -> Floats:
    return np.asarray(gaussian_filter1d(values, sigma, mode="nearest"))


def _passed(smoothings: int, wide: float) -> float:
    """Part of averaged noise that a smoothing takes after others `wide` times as much in square."""
    before = smoothings * wide
    return float(
        1 / np.sqrt(1 + before)
        - 2 / np.sqrt(1 + before + wide / 2)
        + 1 / np.sqrt(1 + before + wide)
    )


def _mixed(pixels: Signal, direction: Floats) -> Signal:
    """One signal from the channels."""
    if pixels.shape[2] == 1:
        return np.asarray(pixels[..., 0] * np.float32(direction[0]))
    return np.asarray(pixels @ direction.astype(np.float32))


def averaged_at(values: Signal, rows: Rows, sigma: float) -> Signal:
    """Gaussian averages over rows, at some rows only."""
    return np.asarray(averages_at(values, rows, (sigma,))[0])


def averages_at(values: Signal, rows: Rows, sigmas: Sequence[float]) -> Signal:
    """As `averaged_at` for several sigmas, the largest first, shape (sigmas, rows, ...)."""
    half = int(3 * sigmas[0] + 0.5)
    taps = np.arange(-half, half + 1)
    kernels = np.exp(-0.5 * (taps / np.array(sigmas)[:, None]) ** 2)
    kernels[np.abs(taps) > 3 * np.array(sigmas)[:, None] + 0.5] = 0.0
    kernels = (kernels / kernels.sum(axis=1, keepdims=True)).astype(np.float32)
    flat = np.pad(values.reshape(len(values), -1), [(half, half), (0, 0)], mode="edge")
    around = sliding_window_view(flat, len(taps), axis=0)[_as_slice(rows)].swapaxes(1, 2)
    found = np.matmul(kernels, around).swapaxes(0, 1)
    return np.asarray(found.reshape(len(sigmas), len(rows), *values.shape[1:]))


def _as_slice(rows: Rows) -> Rows | slice:
    """Evenly spaced rows as a slice, which copies nothing."""
    step = int(rows[1] - rows[0]) if len(rows) > 1 else 1
    even = step > 0 and bool((np.diff(rows) == step).all())
    return slice(int(rows[0]), int(rows[-1]) + 1, step) if even else rows


def columns_of_change(profiles: Signal) -> float:
    """Columns that the change over profiles (rows, columns) takes at its steepest, the median.

    A step with a blur of sigma takes sqrt(2 pi) sigma.
    """
    calm = cv2.GaussianBlur(profiles, (0, 0), sigmaX=1.0, sigmaY=0.01)
    level = max(2, profiles.shape[1] // 8)
    change = np.abs(calm[:, :level].mean(axis=1) - calm[:, -level:].mean(axis=1))
    steepest = np.abs(np.gradient(calm, axis=1)).max(axis=1)
    return float(np.median(change / np.maximum(steepest, 1e-3)))


def _least_risk(places: Floats, shares: Floats, noise: float) -> float:
    """The share of least risk; `places` (shares, rows), `noise` the variance at the last share."""
    ratio, noise = shares[-1] / shares, max(noise, _SENSOR_PX**2)
    covariance = np.sqrt(2) * shares[-1] / np.hypot(shares[-1], shares)
    apart = (1.4826 * np.median(np.abs(places - places[-1]), axis=1)) ** 2
    risk = apart - noise * (1 + ratio - 2 * covariance) + noise * ratio
    return float(shares[int(np.argmax(risk <= 1.1 * risk.min()))])
