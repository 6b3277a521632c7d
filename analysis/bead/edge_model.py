"""Sub-pixel place of a toe: matched subspaces of a blurred step, shading and a dark line.

For each shift of the edge the profile across the toe is projected on a small subspace; the shift
that captures most of it wins. Shading and lines beside a toe vary slowly along it: the model is
chosen, and they are fitted, on means over stretches of the toe. Taken off, they leave a plain
step to each row, which is the least noisy thing to place.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.special import erf

Floats = NDArray[np.float64]

_BLURS_PX = tuple(float(blur) for blur in np.geomspace(0.6, 5.0, 10))
_MODELS: dict[str, tuple[str, ...]] = {
    "step": (),
    "line": ("line",),
    "broad line": ("broad line",),
    "ramps": ("ramps",),
    "ramps, line": ("ramps", "line"),
    "curves": ("ramps", "curves"),
    "curves, line": ("ramps", "curves", "line"),
    "curves, broad line": ("ramps", "curves", "broad line"),
}
_LINES_PX = {"line": 1.2, "broad line": 2.5}
"""Distance of a dark line from the edge, which is also its standard deviation."""
_STEP = 0.125
_GREY_FLOOR = 0.02
"""Variance in grey levels that any mean profile has: rounding to 8 bit, the model of the blur."""
_EDGE_FLOOR = 0.01
"""The same as a part of the step: no real blur is quite Gaussian."""
_PRICE = 0.1
"""How much lower (log) the misfit must be for each further parameter."""
_BLOCKS = 16
_LAGS = 6
"""Columns over which noise and texture across a toe may be correlated."""
_TRUST = 0.25
"""Part of what a richer model moves an edge by that stays in doubt."""


@dataclass(frozen=True, slots=True)
class Window:
    """Columns around an edge that are looked at: `outside` of them on the plate, `inside` bead."""

    outside: int
    inside: int

    def around(self, blur: float) -> "Window":
        """The part that an edge of this blur needs, so that little else is in it."""
        return Window(
            min(self.outside, max(8, int(6 * blur) + 4)),
            min(self.inside, max(6, int(5 * blur) + 3)),
        )

    @property
    def columns(self) -> Floats:
        """Distance of each column from the edge, the bead towards larger ones."""
        return np.arange(-self.outside, self.inside + 1, dtype=np.float64)

    @property
    def weight(self) -> Floats:
        """1 near the edge, falling to a tenth at the borders."""
        at = self.columns
        share = np.where(at < 0, -at / (self.outside + 1), at / (self.inside + 1))
        fall = np.clip((share - 0.6) / 0.4, 0, 1)
        return np.asarray(0.55 + 0.45 * np.cos(np.pi * fall))


@dataclass(frozen=True, slots=True)
class EdgePlaces:
    """Per row: column of the edge, its random standard uncertainty, that of the model, the step.

    `bare` is the step without the shading beside it, `model` says what that is, `blur_px` how
    blurred the edge is.
    """

    column: Floats
    u_noise: Floats
    u_model: Floats
    height: Floats
    bare: Floats
    model: str
    blur_px: float


@dataclass(frozen=True, slots=True)
class EdgeModel:
    """What was chosen for a toe: model, blur, the doubt between models, and what is not step.

    `shading` (blocks, window) are ramps and lines beside the step at equal stretches of the toe.
    """

    window: Window
    name: str
    blur: float
    u: float
    shading: Floats


@dataclass(frozen=True, slots=True)
class Fit:
    """A model at each row: shift, mean square misfit and variance of the shift for unit noise."""

    shift: Floats
    misfit: Floats
    variance: Floats


def profiles_at(signal: NDArray[np.float32], centre: NDArray[np.int64], window: Window) -> Floats:
    """Profiles (rows, window) around a column per row of a signal with the bead to the right."""
    columns = centre[:, None] + window.columns.astype(np.int64)
    rows = np.arange(len(signal))[:, None]
    return np.asarray(signal[rows, np.clip(columns, 0, signal.shape[1] - 1)], dtype=np.float64)


def choose_model(
    signal: NDArray[np.float32], centre: NDArray[np.int64], window: Window
) -> EdgeModel:
    """The model for a toe: on mean profiles of blocks of rows, aligned by a first plain fit.

    Where there is shading or a line beside the step, a narrower window keeps what is farther
    away out of it.
    """
    model = _chosen(profiles_at(signal, centre, window), window)
    near = window.around(model.blur)
    if model.name == "step" or near == window:
        return model
    return _chosen(profiles_at(signal, centre, near), near)


def _chosen(profiles: Floats, window: Window) -> EdgeModel:
    first = fit(profiles, window, "step", 1.5, 2.5)
    means = _aligned_means(profiles, first.shift)
    found = {name: _best_blur(means, window, name) for name in _MODELS}
    scores = {
        name: score + _PRICE * (_parameters(name) - 2) for name, (score, _, _) in found.items()
    }
    name = min(scores, key=lambda model: scores[model])
    weights = np.array([np.exp((scores[name] - score) / _PRICE) for score in scores.values()])
    places = np.array([float(np.median(shift)) for _, _, shift in found.values()])
    away = places - float(np.median(found[name][2]))
    doubt = float(np.sqrt((weights * away**2).sum() / weights.sum()))
    u = float(np.hypot(doubt, _TRUST * away[list(_MODELS).index("step")]))
    blur = found[name][1]
    shift = fit(means, window, name, blur, 1.5).shift
    shading = _shading(means, window, name, blur, shift)
    return EdgeModel(window, name, blur, u, shading)


def _shading(means: Floats, window: Window, model: str, blur: float, shift: Floats) -> Floats:
    """What a model adds to its step in each mean profile, (blocks, window), edge at column 0."""
    parts = np.zeros_like(means)
    for row, (mean, moved) in enumerate(zip(means, shift, strict=True)):
        basis = _basis(window.columns - moved, model, blur) * window.weight[:, None]
        found = np.linalg.lstsq(basis, mean * window.weight, rcond=None)[0]
        parts[row] = _basis(window.columns, model, blur)[:, 2:] @ found[2:]
    return parts


def _aligned_means(profiles: Floats, shift: Floats) -> Floats:
    """Means of blocks of rows, each row moved by its shift (linear interpolation)."""
    blocks = np.array_split(np.arange(len(profiles)), min(_BLOCKS, max(1, len(profiles) // 4)))
    calm = gaussian_filter1d(shift, 5.0, mode="nearest")
    whole = np.floor(calm).astype(np.int64)
    part = (calm - whole)[:, None]
    columns = np.arange(profiles.shape[1]) + whole[:, None]
    rows, last = np.arange(len(profiles))[:, None], profiles.shape[1] - 1
    low = profiles[rows, np.clip(columns, 0, last)]
    moved = low + part * (profiles[rows, np.clip(columns + 1, 0, last)] - low)
    return np.array([moved[block].mean(axis=0) for block in blocks])


def _best_blur(means: Floats, window: Window, model: str) -> tuple[float, float, Floats]:
    """Log misfit at the best blur, that blur, and the shifts of the rows there."""
    shifts, bases = _subspaces(window, model, _BLURS_PX, 1.5)
    weighted = (means - means.mean(axis=1, keepdims=True)) * window.weight
    shape = (len(means), len(_BLURS_PX), len(shifts), -1)
    captured = ((weighted @ bases) ** 2).reshape(shape).sum(axis=3)
    best = captured.max(axis=2)
    freedom = max(float((window.weight**2).sum()) - _parameters(model) - 1, 1.0)
    misfit = np.median((weighted**2).sum(axis=1)[:, None] - best, axis=0) / freedom
    floor = _GREY_FLOOR + (_EDGE_FLOOR * float(np.median(np.ptp(means, axis=1)))) ** 2
    logs = np.log(np.maximum(misfit, 0) + floor)
    at = int(np.clip(np.argmin(logs), 1, len(logs) - 2))
    a, b, c = logs[at - 1 : at + 2]
    move = float(np.clip(0.5 * (a - c) / max(a - 2 * b + c, 1e-9), -1, 1))
    blur = round(float(_BLURS_PX[at] * (_BLURS_PX[1] / _BLURS_PX[0]) ** move), 2)
    places, _, _ = _peak(captured[:, int(np.argmin(logs))], shifts)
    return float(b - 0.25 * (a - c) * move), blur, places


def _peak(captured: Floats, shifts: Floats) -> tuple[Floats, Floats, Floats]:
    """Shift of each row's most captured energy, that energy, its (negative) second difference."""
    peak = np.clip(np.argmax(captured, axis=1), 1, len(shifts) - 2)
    a, b, c = (captured[np.arange(len(peak)), peak + k] for k in (-1, 0, 1))
    curvature = np.minimum(a - 2 * b + c, -1e-9)
    return shifts[peak] + np.clip(0.5 * (a - c) / curvature, -1, 1) * _STEP, b, curvature


def _parameters(model: str) -> int:
    extra = {"line": 1, "broad line": 1, "ramps": 2, "curves": 2}
    return 2 + sum(extra[part] for part in _MODELS[model])


def fit(profiles: Floats, window: Window, model: str, blur: float, reach: float) -> Fit:
    """The best shift of each profile within `reach` columns, by captured energy."""
    shifts, bases = _subspaces(window, model, (blur,), reach)
    weighted = (profiles - profiles.mean(axis=1, keepdims=True)) * window.weight
    projected = weighted @ bases
    captured = (projected**2).reshape(len(profiles), len(shifts), -1).sum(axis=2)
    places, most, curvature = _peak(captured, shifts)
    misfit = np.maximum((weighted**2).sum(axis=1) - most, 1e-9)
    return Fit(places, misfit, _STEP**2 / (-0.5 * curvature))


@cache
def _subspaces(
    window: Window, model: str, blurs: tuple[float, ...], reach: float
) -> tuple[Floats, Floats]:
    """Shifts, and orthonormal bases of the weighted profiles side by side.

    Shape (window, blurs x shifts x k), the last index fastest.
    """
    shifts = np.arange(-reach, reach + 1e-9, _STEP)
    stacked = np.stack(
        [_basis(window.columns - shift, model, blur) for blur in blurs for shift in shifts]
    )
    bases = np.linalg.qr(stacked * window.weight[None, :, None])[0]
    return shifts, np.ascontiguousarray(bases.transpose(1, 0, 2).reshape(len(window.weight), -1))


def _basis(z: Floats, model: str, blur: float) -> Floats:
    """The model's parts at distances z inside of the edge, (columns, k)."""
    step = 0.5 * (1 + erf(z / (np.sqrt(2) * blur)))
    bell = np.exp(-0.5 * (z / blur) ** 2) / (np.sqrt(2 * np.pi) * blur)
    parts = [np.ones_like(z), step]
    for part in _MODELS[model]:
        if part in _LINES_PX:
            away = _LINES_PX[part]
            parts.append(np.exp(-0.5 * ((z + away) / np.hypot(blur, away)) ** 2))
        else:
            inner = z * step + blur * blur * bell
            if part == "curves":
                inner = (z * z + blur * blur) * step + z * blur * blur * bell
            parts += [inner, (z if part == "ramps" else z * z + blur * blur) - inner]
    return np.array(parts).T


def typical_blur(profiles: Floats, window: Window) -> float:
    """Blur that fits single rows best: where a toe is ragged, their mean is softer than they."""
    scores = []
    for model in ("step", "line", "ramps", "ramps, line"):
        for blur in _BLURS_PX:
            misfit = float(np.median(fit(profiles, window, model, blur, 2.5).misfit))
            freedom = float((window.weight**2).sum()) - _parameters(model) - 1
            score = float(np.log(misfit / max(freedom, 1) + _GREY_FLOOR))
            scores.append((score + _PRICE * (_parameters(model) - 2), blur))
    return min(scores)[1]


def locate_edges(signal: NDArray[np.float32], near: Floats, model: EdgeModel) -> EdgePlaces:
    """Refine edges of `signal` (rows, columns; bead to the right) within two columns of `near`."""
    centre = np.rint(near).astype(np.int64)
    profiles = plain_profiles(signal, centre, model, np.linspace(0, 1, len(near)))
    plain = fit(profiles, model.window, "step", model.blur, 2.5)
    u_noise = _random_u(profiles, plain, model)
    seen = profiles_at(signal, centre, model.window)
    height = _height(seen, plain.shift, model.window, model.blur)
    bare = _height(profiles, plain.shift, model.window, model.blur)
    u_model = np.full(len(near), model.u)
    return EdgePlaces(centre + plain.shift, u_noise, u_model, height, bare, model.name, model.blur)


def plain_profiles(
    signal: NDArray[np.float32], centre: NDArray[np.int64], model: EdgeModel, along: Floats
) -> Floats:
    """Profiles around `centre` without the model's shading; `along` is the place, 0 to 1."""
    profiles = profiles_at(signal, centre, model.window)
    if model.name == "step":
        return profiles
    first = fit(profiles, model.window, model.name, model.blur, 2.5)
    calm = gaussian_filter1d(first.shift + centre, 3.0, mode="nearest") - centre
    blocks = len(model.shading)
    at = np.clip(along * blocks - 0.5, 0, blocks - 1)
    low = np.minimum(at.astype(np.int64), max(blocks - 2, 0))
    part = (at - low)[:, None]
    shading = (1 - part) * model.shading[low] + part * model.shading[
        np.minimum(low + 1, blocks - 1)
    ]
    columns = np.arange(profiles.shape[1]) - calm[:, None]
    left = np.clip(np.floor(columns).astype(np.int64), 0, profiles.shape[1] - 2)
    rows, share = np.arange(len(profiles))[:, None], np.clip(columns - left, 0, 1)
    moved = (1 - share) * shading[rows, left] + share * shading[rows, left + 1]
    return np.asarray(profiles - moved)


def _slow(values: Floats, sigma: float) -> Floats:
    return np.asarray(gaussian_filter1d(values, sigma, mode="nearest"))


def _random_u(profiles: Floats, plain: Fit, model: EdgeModel) -> Floats:
    """Standard uncertainty of each shift from the residuals as they are: uneven and correlated.

    Sandwich estimate (Huber 1967) with the leverage taken out, pooled over the rows for its
    shape, local over some 30 rows for its size.
    """
    window, blur = model.window, model.blur
    z = window.columns[None] - plain.shift[:, None]
    step = 0.5 * (1 + erf(z / (np.sqrt(2) * blur)))
    levels = step - step.mean(axis=1, keepdims=True)
    centred = profiles - profiles.mean(axis=1, keepdims=True)
    height = (centred * levels).sum(axis=1) / np.maximum((levels**2).sum(axis=1), 1e-9)
    residual = centred - height[:, None] * levels
    residual -= residual.mean(axis=0)
    weight = window.weight
    basis = _basis(window.columns, "step", blur) * weight[:, None]
    bell = np.exp(-0.5 * (window.columns / blur) ** 2) / (np.sqrt(2 * np.pi) * blur) * weight
    frame = np.linalg.qr(np.column_stack([basis, bell]))[0]
    direction = frame[:, -1] / float(frame[:, -1] @ bell) * weight
    keep = np.eye(len(weight)) - frame @ frame.T
    left = (residual * weight) @ keep
    pooled = float(direction @ _noise_covariance(left, keep, weight) @ direction)
    size = (left**2).mean(axis=1)
    local = _slow(size, 15.0) / max(float(size.mean()), 1e-12)
    typical = np.maximum(np.abs(height), 0.2 * np.median(np.abs(height)))
    return np.asarray(np.sqrt(np.maximum(pooled * local, 1e-12)) / np.maximum(typical, 1e-6))


def _noise_covariance(left: Floats, keep: Floats, weight: Floats) -> Floats:
    """Covariance of the noise from what a fit has left of it, (window, window).

    `left` (rows, window) are weighted residuals, `keep` the projection that made them. The
    autocovariance to `_LAGS` columns is what gives, through the same projection, the residuals'
    (unbiased, unlike theirs); its size follows the columns.
    """
    size = len(weight)
    lags = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    covariance = left.T @ left / len(left)
    count = min(_LAGS, size - 1)
    weighed = keep * weight

    def sums(matrix: Floats) -> Floats:
        return np.asarray(np.bincount(lags.ravel(), matrix.ravel())[:count], dtype=np.float64)

    system = np.array([sums(weighed @ (lags == lag) @ weighed.T) for lag in range(count)]).T
    found = np.zeros(size)
    found[:count] = np.linalg.lstsq(system, sums(covariance), rcond=None)[0]
    share = np.diag(covariance) / np.maximum(np.diag(weighed @ weighed.T), 1e-3)
    scale = np.sqrt(np.maximum(share / max(float(np.average(share, weights=weight)), 1e-12), 0.05))
    return np.asarray(found[lags] * np.outer(scale, scale), dtype=np.float64)


def _height(profiles: Floats, shift: Floats, window: Window, blur: float) -> Floats:
    """Inside minus outside level, just beyond the blur."""
    reach = 2.0 * blur + 1
    rows, last = np.arange(len(shift)), profiles.shape[1] - 1
    inside = np.clip(np.rint(window.outside + shift + reach).astype(int), 0, last)
    outside = np.clip(np.rint(window.outside + shift - reach).astype(int), 0, last)
    return np.asarray(profiles[rows, inside] - profiles[rows, outside])
