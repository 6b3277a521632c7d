"""From coarse toes to sub-pixel ones, in windows along each toe at the photo's own resolution."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from seamlog.errors import EvidenceError

from .chain import best_chains
from .curve import Centreline
from .edge_model import EdgeModel, choose_model, profiles_at, spread, typical_blur
from .edge_places import EdgePlaces, locate_edges, random_u, ruler_for
from .edge_shapes import Window
from .image import Photo
from .plane import Plane
from .sampling import sample_rows
from .series import calmed, median
from .width import Toes
from .zones import fisher_direction

Floats = NDArray[np.float64]
Signal = NDArray[np.float32]
Rows = NDArray[np.int64]

_ALONG_PX = 4.0
_ALONG_WIDTHS = 0.03
"""Gaussian averaging along the seam: this many px at most, or this part of the width if more."""
_SHARES = np.array((1.0, 0.65, 0.42, 0.27, 0.18))
"""Parts of the longest averaging that are tried."""
_CALM = 1.5
"""Windows follow the coarse toe averaged over this many longest averagings: what they average
must lie along a straight line."""
_WINDOW_PX = 18
_SEARCHED = 0.08
"""Half widths around the coarse toe in which the sharpest edge is looked for."""
_TRIED_ROWS, _SOFT_ROWS = 160, 80
"""Rows on which the colours and the averaging of a toe are tried, and its softness."""
_SENSOR_PX = 0.02
"""Noise that the place of any edge has by the pixels' raster, at the shortest averaging."""
_RASTER_PX = 0.02
"""Standard uncertainty that the raster and the unknown shape of the blur leave at the longest."""
_SHARP_PX = 2.0
"""Blur up to which a toe is not looked at twice."""
_LEAST_SMOOTHING = 1.0
"""Stations (Gaussian sigma) from which on a smoothing of stations is a Gaussian."""
_MOST_SMEARED = 2.5
"""Waviness that was lost, in parts of what one more smoothing takes, at most."""
_ENOUGH = 64
_RISE = np.array([[-0.5, 0.0, 0.5]], dtype=np.float32)


@dataclass(frozen=True, slots=True)
class Rough:
    """Coarse toes per row of a line: offsets in the plane's unit, and how bead-like the inside."""

    left: Floats
    right: Floats
    present: Floats

    @property
    def half(self) -> float:
        """Typical half width."""
        return median(self.right - self.left) / 2


def longest_px(half_px: float) -> float:
    """The longest averaging along a toe that is tried (Gaussian sigma)."""
    return max(_ALONG_PX, 2 * _ALONG_WIDTHS * half_px)


def refine_toes(
    photo: Photo, plane: Plane, line: Centreline, rough: Rough, unit: float, every: int
) -> tuple[Toes, Toes]:
    """Sub-pixel toes of both sides at each `every`-th row of `line`; `unit` is a px's length."""
    toes = ((rough.left, -1), (rough.right, 1))
    left, right = (_Side(photo, plane, line, *toe, rough, unit, every) for toe in toes)
    near = _sharpest(np.stack([left.calm, right.calm]), left.search)
    return left.refined(near[0]), right.refined(near[1])


def _sharpest(signals: Signal, reach: float) -> Floats:
    """Chain of the steepest rises within reach of the middle column, for each of the signals."""
    smooth = [cv2.GaussianBlur(signal, (0, 0), sigmaX=1.5, sigmaY=1.0)[::2] for signal in signals]
    rise = np.stack([cv2.filter2D(one, -1, _RISE) for one in smooth])
    columns = np.arange(signals.shape[2])
    near = np.abs(columns - columns[-1] / 2) <= reach
    typical = np.array([median(one) for one in np.where(near, rise, 0).max(axis=2)]) + 1e-6
    score = rise / typical.astype(np.float32)[:, None, None]
    score = np.where(near, np.minimum(np.maximum(score, 0), 1.5), np.float32(-1e6))
    rows = np.arange(signals.shape[1])
    return np.array([np.interp(rows, rows[::2], chain) for chain in best_chains(score, 0.1)])


class _Side:
    """One toe: its windows, the bead to the right, as the mixture of colours that tells most.

    `calm` is that signal at each `every`-th row, averaged as long as is tried, and `search` how
    many columns around its middle the toe may be.
    """

    def __init__(
        self,
        photo: Photo,
        plane: Plane,
        line: Centreline,
        toe: Floats,
        side: int,
        rough: Rough,
        unit: float,
        every: int,
    ) -> None:
        half_px, row_px = rough.half / unit, float(line.s[1] - line.s[0]) / unit
        self._longest = longest_px(half_px) / row_px
        toe = calmed(toe, _CALM * self._longest)
        self._rough, self._toe, self._side, self._unit = rough, toe, side, unit
        self._row_px, self._every = row_px, every
        self._pick = np.arange(every // 2, len(toe), every)
        self.search = 3 + _SEARCHED * half_px
        inside = max(3, min(_WINDOW_PX, int(0.8 * half_px)))
        self._window = Window(_WINDOW_PX, inside)
        self._reach = _WINDOW_PX + int(np.ceil(self.search)) + 3
        step = -side * unit
        first = toe - self._reach * step
        pixels, valid = sample_rows(photo, plane, line, first, step, 2 * self._reach + 1)
        self._valid = valid[self._pick]
        depth = int(max(4, min(0.25 * half_px, self._reach)))
        calm = averaged_at(pixels, self._pick, self._longest)
        inner, outer = self._beside(calm, depth)
        if min(len(inner), len(outer)) < _ENOUGH:
            raise EvidenceError(
                f"{photo.name}: the plate beside the bead is not in the photo, so its toe cannot "
                "be told; take the photo with plate on both sides"
            )
        direction, self._distance = fisher_direction(inner, outer)
        self._signal, self.calm = _mixed(pixels, direction), _mixed(calm, direction)

    def _beside(self, calm: Signal, depth: int) -> tuple[Signal, Signal]:
        """Samples of the bead and of the plate, `depth` columns from the coarse toe."""
        rows, toe = spread(len(calm), _TRIED_ROWS), self._reach
        samples, valid = calm[rows], self._valid[rows]
        bead, plate = slice(toe + 1, toe + depth), slice(toe - depth + 1, toe)
        return samples[:, bead][valid[:, bead]], samples[:, plate][valid[:, plate]]

    def refined(self, near: Floats) -> Toes:
        """The toe at each row of `calm`, where columns `near` it are known."""
        model = choose_model(self.calm, np.rint(near).astype(np.int64), self._window)
        share = self._averaging(near, model)
        signal = self.calm
        if share < 1:
            signal = averaged_at(self._signal, self._pick, share * self._longest)
        places = locate_edges(signal, near, model)
        smeared = self._smeared(places, share) if share < 1 else 0.0
        return self._toes(places, smeared, share, self._softness(signal, near, model))

    def _softness(self, signal: Signal, near: Floats, model: EdgeModel) -> float:
        """Blur of the toe; that of single rows where their mean is soft, for a toe is ragged."""
        if model.blur <= _SHARP_PX:
            return model.blur
        rows = spread(len(near), _SOFT_ROWS)
        profiles = profiles_at(signal[rows], np.rint(near[rows]).astype(np.int64), self._window)
        return typical_blur(profiles, self._window)

    def _smeared(self, places: EdgePlaces, share: float) -> float:
        """Px of the toe's own waviness that blur and averaging take away, rms.

        One more smoothing leaves the part `left` of what it takes to a second one: that of a wave
        of one length, of which the own smoothing left a part as well. Stations sample no smoothing
        finer than themselves, so this one may be broader than the own. Giving back what was lost
        by deconvolution was tried: on a textured plate it amplifies more noise than it restores.
        """
        averaged = share * self._longest / self._every
        own = float(np.hypot(places.blur_px / self._row_px / self._every, averaged))
        broad = max(own, _LEAST_SMOOTHING)
        taken = places.column - calmed(places.column, broad)
        again = calmed(taken, broad)
        noise = median(places.u_noise) ** 2
        first, second = (
            float(np.var(values)) - noise * _passed(times, broad, averaged)
            for times, values in enumerate((taken, again))
        )
        if first <= 0 or second <= 0:
            return 0.0
        left = min(float(np.sqrt(second / first)), 0.999)
        kept = left ** ((own / broad) ** 2)
        lost = (1 - kept) / (kept * (1 - left))
        return float(np.sqrt(first) * min(lost, _MOST_SMEARED))

    def _averaging(self, near: Floats, model: EdgeModel) -> float:
        """Part of the longest averaging with the least expected error (Stein's estimate).

        One ruler measures all, so that the places differ by what averaging does and nothing else.
        """
        rows = spread(len(near), _TRIED_ROWS)
        centre = np.rint(near[rows]).astype(np.int64)
        signals = averages_at(self._signal, self._pick[rows], _SHARES * self._longest)
        seen = profiles_at(signals, centre, model.window)
        plain = seen - model.shading[rows]
        found = ruler_for(plain[-1], model).places(plain)
        noise = median(random_u(found.misfit[-1], found.variance[-1], model.window)) ** 2
        return _least_risk(centre + found.shift, _SHARES, noise)

    def _toes(self, places: EdgePlaces, smeared: float, share: float, soft_px: float) -> Toes:
        column = places.column
        rows = np.arange(len(column))
        beyond = column - 3 - 2 * places.blur_px
        outside = np.clip(np.rint(beyond).astype(int), 0, 2 * self._reach)
        inward = column - self._reach
        followed = calmed(self._toe, share * self._longest)[self._pick]
        return Toes(
            offset=followed - self._side * self._unit * inward,
            u_noise=places.u_noise * self._unit,
            u_model=np.hypot(places.u_model, _RASTER_PX) * self._unit,
            smeared=smeared * self._unit,
            height=places.height,
            bare=places.bare,
            within=places.within,
            in_frame=self._valid[rows, outside],
            present=self._rough.present[self._pick],
            disagreement=np.abs(inward) * self._unit,
            distance=self._distance,
            blur_px=soft_px,
        )


def _passed(times: int, sigma: float, averaged: float) -> float:
    """Part of the variance of noise, averaged before, that a smoothing takes after `times` others.

    Sigmas in samples.
    """
    reach = 4 * int(np.ceil((times + 2) * sigma)) + 1
    one = np.zeros(2 * reach + 1)
    one[reach] = 1.0
    for _ in range(times):
        one = calmed(one, sigma)
    taken = one - calmed(one, sigma)
    alike = np.exp(-0.25 * (np.arange(-2 * reach, 2 * reach + 1) / averaged) ** 2)
    return float(np.convolve(taken, taken[::-1]) @ alike)


def _mixed(pixels: Signal, direction: Floats) -> Signal:
    """One signal from the channels."""
    if pixels.shape[2] == 1:
        return np.asarray(pixels[..., 0] * np.float32(direction[0]))
    return np.asarray(pixels @ direction.astype(np.float32))


def averaged_at(values: Signal, rows: Rows, sigma: float) -> Signal:
    """Gaussian averages over rows, at some rows only."""
    return np.asarray(averages_at(values, rows, np.array([sigma]))[0])


def averages_at(values: Signal, rows: Rows, sigmas: Floats) -> Signal:
    """As `averaged_at` for several sigmas, the largest first, shape (sigmas, rows, ...)."""
    half = int(3 * sigmas[0] + 0.5)
    taps = np.arange(-half, half + 1)
    kernels = np.exp(-0.5 * (taps / sigmas[:, None]) ** 2)
    kernels[np.abs(taps) > 3 * sigmas[:, None] + 0.5] = 0.0
    kernels = (kernels / kernels.sum(axis=1, keepdims=True)).astype(np.float32)
    flat = values.reshape(len(values), -1)
    longer = cv2.copyMakeBorder(flat, half, half, 0, 0, cv2.BORDER_REPLICATE)
    around = sliding_window_view(longer, len(taps), axis=0)[_as_slice(rows)].swapaxes(1, 2)
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
    return median(change / np.maximum(steepest, 1e-3))


def _least_risk(places: Floats, shares: Floats, noise: float) -> float:
    """The share of least risk; `places` (shares, rows), `noise` the variance at the last share."""
    ratio, noise = shares[-1] / shares, max(noise, _SENSOR_PX**2)
    covariance = np.sqrt(2) * shares[-1] / np.hypot(shares[-1], shares)
    apart = (1.4826 * np.median(np.abs(places - places[-1]), axis=1)) ** 2
    risk = apart - noise * (1 + ratio - 2 * covariance) + noise * ratio
    return float(shares[int(np.argmax(risk <= 1.1 * risk.min()))])
