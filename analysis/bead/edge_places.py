"""The place of a toe in each row: a blurred step among the textures of plate and bead.

A bead's ripple is coarser and stronger than its plate's grain, so the columns of a profile are not
equally telling. Their noise is measured on both sides and the fit weighted by it (generalised
least squares, Aitken 1936).
"""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from .edge_model import EDGE_FLOOR, GREY_FLOOR, EdgeModel, aligned_means, profiles_at
from .edge_shapes import Floats, Profiles, Ruler, Window, even_ruler, step_at
from .series import calmed, median

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
    plain = seen - model.shading
    found = ruler_for(plain, model).places(plain)
    shift = found.shift - _astray(plain, found.shift, model)
    return EdgePlaces(
        column=centre + shift,
        within=calmed(np.abs(found.shift) > _REACH - 0.1, 2.0) < 0.6,
        u_noise=random_u(found.misfit, found.variance, model.window),
        u_model=np.full(len(near), model.u),
        height=_height(seen, shift, model.window, model.blur),
        bare=_height(plain, shift, model.window, model.blur),
        blur_px=model.blur,
    )


def ruler_for(plain: Profiles, model: EdgeModel) -> Ruler:
    """A ruler for steps with the blur of a model among the noise of the columns of `plain`."""
    return Ruler.of(_whitening(plain, model), model.window, model.blur, _REACH)


def _whitening(plain: Profiles, model: EdgeModel) -> Floats:
    """Matrix (window, window) that makes the noise of profiles even and independent.

    Plate and bead have each their own stationary texture, seen where the edge is not.
    """
    window, blur = model.window, model.blur
    at = window.columns
    texture = plain - cv2.blur(plain, (1, _SLOW), borderType=cv2.BORDER_REPLICATE)
    # over rows that lie together: NumPy takes twice as long over each short one
    size = median(np.ptp(plain.T.copy(), axis=0))
    covariance = np.eye(len(at)) * (GREY_FLOOR + (EDGE_FLOOR * size) ** 2)
    step, clear = step_at(at, blur), 2.0 * blur + 1.5
    plate = at < -min(clear, window.outside - 2)
    bead = at > min(clear, window.inside - 2)
    for part, share in ((plate, 1 - step), (bead, step)):
        own = _autocovariance(texture[:, part], len(at))
        covariance += own[_lags(len(at))] * np.sqrt(np.outer(share, share))
    weight = window.weight
    return np.linalg.inv(np.linalg.cholesky(covariance / np.outer(weight, weight)))


@cache
def _lags(count: int) -> NDArray[np.int64]:
    """How many columns each column is from each other."""
    return np.abs(np.subtract.outer(np.arange(count), np.arange(count)))


def _autocovariance(texture: Profiles, lags: int) -> Floats:
    """Autocovariance across columns, biased so that it is positive definite, (lags,)."""
    rows, count = texture.shape
    products = texture.T @ texture / (rows * count)
    both = np.bincount(_lags(count).ravel(), products.ravel(), minlength=lags)[:lags]
    return np.asarray(both / np.where(np.arange(lags), 2, 1))


def _astray(plain: Profiles, shift: Floats, model: EdgeModel) -> float:
    """How far the rows' places are beside that of their mean profile.

    Weights that are not even let what the shading has left pull at them; on means it is less.
    """
    means = aligned_means(plain, shift)
    return -median(even_ruler(model.window, model.blur, 1.5).places(means).shift)


def random_u(misfit: Floats, variance: Floats, window: Window) -> Floats:
    """Standard uncertainty of each row's shift; the misfit of some 30 tells the noise's size.

    Means of logarithms, so that a drop of spatter in a few rows does not count for all.
    """
    freedom = max(window.size - 3, 1)
    noise = np.exp(calmed(np.log(misfit), 15.0) + 1 / freedom) / freedom
    return np.asarray(np.sqrt(np.exp(calmed(np.log(variance), 3.0)) * noise))


def _height(profiles: Profiles, shift: Floats, window: Window, blur: float) -> Floats:
    """Inside minus outside level, just beyond the blur."""
    reach = 2.0 * blur + 1
    rows, last = np.arange(len(shift)), profiles.shape[1] - 1
    inside = np.clip(np.rint(window.outside + shift + reach).astype(int), 0, last)
    outside = np.clip(np.rint(window.outside + shift - reach).astype(int), 0, last)
    return calmed(profiles[rows, inside] - profiles[rows, outside], 3.0)
