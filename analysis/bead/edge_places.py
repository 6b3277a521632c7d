"""The place of a toe in each row: a blurred step among the textures of plate and bead.

A bead's ripple is coarser and stronger than its plate's grain, so the columns of a profile are not
equally telling. Their noise is measured on both sides and the fit weighted by it (generalised
least squares, Aitken 1936).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from .edge_model import (
    EDGE_FLOOR,
    GREY_FLOOR,
    EdgeModel,
    aligned_means,
    alignment,
    moved,
    profiles_at,
)
from .edge_shapes import (
    Fit,
    Floats,
    Projected,
    Window,
    basis,
    best_shifts,
    fit,
    shifts_within,
    side_by_side,
    step_at,
)

_REACH = 4.0
"""Columns around where an edge is looked for."""
_SLOW = 61
"""Rows over which what varies more slowly than texture is averaged."""


@dataclass(frozen=True, slots=True)
class EdgePlaces:
    """Per row: column of the edge, its random standard uncertainty, that of the model, the step.

    `bare` is the step without the shading beside it, `blur_px` how blurred the edge is, `within`
    whether the edge was within reach of where it was looked for.
    """

    column: Floats
    within: NDArray[np.bool_]
    u_noise: Floats
    u_model: Floats
    height: Floats
    bare: Floats
    blur_px: float


def locate_edges(signal: NDArray[np.float32], near: Floats, model: EdgeModel) -> EdgePlaces:
    """Refine edges of `signal` (rows, columns; bead to the right) within `_REACH` of `near`."""
    centre = np.rint(near).astype(np.int64)
    seen = profiles_at(signal, centre, model.window)
    plain = seen - shading_along(seen, centre, model)
    found = ruler_for(plain, model).places(plain)
    shift = found.shift - _astray(plain, found.shift, model)
    return EdgePlaces(
        column=centre + shift,
        within=_slow(np.abs(found.shift) > _REACH - 0.1, 2.0) < 0.6,
        u_noise=random_u(found, model.window),
        u_model=np.full(len(near), model.u),
        height=_height(seen, shift, model.window, model.blur),
        bare=_height(plain, shift, model.window, model.blur),
        blur_px=model.blur,
    )


def shading_along(profiles: Floats, centre: NDArray[np.int64], model: EdgeModel) -> Floats:
    """The model's shading in each profile: that of the blocks before and behind."""
    if model.name == "step":
        return np.zeros_like(profiles)
    blocks = len(model.shading)
    at = np.clip(np.linspace(0, blocks, len(profiles)) - 0.5, 0, blocks - 1)
    low = np.minimum(at.astype(np.int64), max(blocks - 2, 0))
    part = (at - low)[:, None]
    shift = -alignment(profiles, centre, model.window)
    before = moved(model.shading, low, shift)
    behind = moved(model.shading, np.minimum(low + 1, blocks - 1), shift)
    return np.asarray((1 - part) * before + part * behind)


@dataclass(frozen=True, slots=True)
class Ruler:
    """What measures steps: `white` (window, window) evens the noise, `bases` as `best_shifts`."""

    white: Floats
    bases: Projected
    shifts: Floats

    def places(self, plain: Floats) -> Fit:
        """The step's shift in each row without shading."""
        weighted = (plain - plain.mean(axis=1, keepdims=True)) @ self.white.T
        return best_shifts(weighted.astype(np.float32), self.bases, self.shifts)


def ruler_for(plain: Floats, model: EdgeModel) -> Ruler:
    """A ruler for steps with the blur of a model among the noise of the columns of `plain`."""
    white = _whitening(plain, model)
    shifts = shifts_within(_REACH)
    at = model.window.columns - shifts[:, None]
    return Ruler(white, side_by_side(white @ basis(at, "step", model.blur)), shifts)


def _whitening(plain: Floats, model: EdgeModel) -> Floats:
    """Matrix (window, window) that makes the noise of profiles even and independent.

    Plate and bead have each their own stationary texture, seen where the edge is not.
    """
    at, blur = model.window.columns, model.blur
    texture = plain - cv2.blur(plain, (1, _SLOW), borderType=cv2.BORDER_REPLICATE)
    lags = np.abs(np.subtract.outer(np.arange(len(at)), np.arange(len(at))))
    size = float(np.median(np.ptp(plain, axis=1)))
    covariance = np.eye(len(at)) * (GREY_FLOOR + (EDGE_FLOOR * size) ** 2)
    step, clear = step_at(at, blur), 2.0 * blur + 1.5
    window = model.window
    plate, bead = at < -min(clear, window.outside - 2), at > min(clear, window.inside - 2)
    for part, share in ((plate, 1 - step), (bead, step)):
        own = _autocovariance(texture[:, part], len(at))
        covariance += own[lags] * np.sqrt(np.outer(share, share))
    weight = model.window.weight
    return np.linalg.inv(np.linalg.cholesky(covariance / np.outer(weight, weight)))


def _autocovariance(texture: Floats, lags: int) -> Floats:
    """Autocovariance across columns, biased so that it is positive definite, (lags,)."""
    count = texture.shape[1]
    apart = np.subtract.outer(np.arange(count), np.arange(count))
    products = texture.T @ texture / len(texture)
    found = np.bincount(np.abs(apart).ravel(), products.ravel(), minlength=lags)[:lags] / count
    found[1:] /= 2
    return np.asarray(found, dtype=np.float64)


def _astray(plain: Floats, shift: Floats, model: EdgeModel) -> float:
    """How far the rows' places are beside that of their mean profile.

    Weights that are not even let what the shading has left pull at them; on means it is less.
    """
    means = aligned_means(plain, shift)
    return -float(np.median(fit(means, model.window, "step", model.blur, 1.5).shift))


def random_u(found: Fit, window: Window) -> Floats:
    """Standard uncertainty of each shift; the misfit of some 30 rows tells the noise's size.

    Means of logarithms, so that a drop of spatter in a few rows does not count for all.
    """
    freedom = max(window.size - 3, 1)
    noise = np.exp(_slow(np.log(found.misfit), 15.0) + 1 / freedom) / freedom
    return np.asarray(np.sqrt(np.exp(_slow(np.log(found.variance), 3.0)) * noise))


def _slow(values: Floats | NDArray[np.bool_], sigma: float) -> Floats:
    return np.asarray(gaussian_filter1d(values.astype(np.float64), sigma, mode="nearest"))


def _height(profiles: Floats, shift: Floats, window: Window, blur: float) -> Floats:
    """Inside minus outside level, just beyond the blur."""
    reach = 2.0 * blur + 1
    rows, last = np.arange(len(shift)), profiles.shape[1] - 1
    inside = np.clip(np.rint(window.outside + shift + reach).astype(int), 0, last)
    outside = np.clip(np.rint(window.outside + shift - reach).astype(int), 0, last)
    return _slow(profiles[rows, inside] - profiles[rows, outside], 3.0)
