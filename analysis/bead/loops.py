"""The bead's innermost loops as machine code (numba, extra `fast`), for who measures many photos.

NumPy spends most of a bead's time on its price per call. To load the machine code takes a third
of a second, as long as it saves on some 50 photos, so it is used within `as_machine_code` only. The
results are the same to the bit.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.compiled import machine_code

Floats = NDArray[np.float32]
Rows = NDArray[np.int64]

MANY = 60
"""Photos from which on loading the machine code pays."""
_used: dict[str, Callable[..., Any]] = {}


@contextmanager
def as_machine_code() -> Iterator[None]:
    """Use the machine code meanwhile; without numba nothing changes."""
    before = dict(_used)
    for plain in (
        projected,
        evident,
        contrasted,
        gathered,
        walked_back,
        counted,
        looked_up,
        scored,
        chains,
        profiles,
        moved,
        vertices,
    ):
        compiled = machine_code(plain)
        if compiled is not None:
            _used[plain.__name__] = compiled
    try:
        yield
    finally:
        _used.clear()
        _used.update(before)


def loaded(plain: Callable[..., Any]) -> Callable[..., Any] | None:
    """The machine code of a loop of this module, if it is used."""
    return _used.get(plain.__name__)


def projected(base: Floats, slope: Floats, count: int) -> tuple[Floats, Floats]:
    """As `sampling._projected`."""
    rows = len(base)
    x, y = np.empty((rows, count), np.float32), np.empty((rows, count), np.float32)
    for row in range(rows):
        x0, y0, w0 = base[row]
        x1, y1, w1 = slope[row]
        for k in range(count):
            at = np.float32(k)
            w = w0 + w1 * at
            x[row, k] = (x0 + x1 * at) / w
            y[row, k] = (y0 + y1 * at) / w
    return x, y


def chains(score: Floats, cost: np.float32) -> Rows:
    """As `chain._chains`."""
    count, rows, columns = score.shape
    middle = (rows - 1) // 2
    steps = rows - middle
    found = np.empty((count, rows), dtype=np.int64)
    moves = np.empty((2, steps, columns), dtype=np.int8)
    values = np.empty((2, 2, columns + 2), dtype=np.float32)
    for one in range(count):
        values[:] = -np.inf
        for side in range(2):
            length = middle + 1 if side == 0 else steps
            for step in range(length):
                row = step if side == 0 else rows - 1 - step
                before, now = values[side, (step + 1) % 2], values[side, step % 2]
                for k in range(columns):
                    own = score[one, row, k] if row != middle or side == 0 else np.float32(0)
                    if step == 0:
                        now[k + 1] = own
                        continue
                    same, less, more = before[k + 1], before[k] - cost, before[k + 2] - cost
                    move, best = 0, same
                    if less > same and less >= more:
                        move, best = -1, less
                    elif more > same and more > less:
                        move, best = 1, more
                    moves[side, step, k] = move
                    now[k + 1] = own + best
        forth, back = values[0, middle % 2], values[1, (steps - 1) % 2]
        column = 0
        for k in range(columns):
            if forth[k + 1] + back[k + 1] > forth[column + 1] + back[column + 1]:
                column = k
        found[one, middle] = column
        at = column
        for step in range(middle, 0, -1):
            at += moves[0, step, at]
            found[one, step - 1] = at
        at = column
        for step in range(steps - 1, 0, -1):
            at += moves[1, step, at]
            found[one, rows - step] = at
    return found


def gathered(
    score: Floats, evident: np.float32, widen: np.float32, move: np.float32, slope: int
) -> Floats:
    """As `band._gathered`."""
    rows, high, wide = score.shape
    stride = wide + 2 * slope
    states = np.full((rows, high + 2, stride), np.float32(-np.inf), dtype=np.float32)
    for row in range(rows):
        for h in range(high):
            inner = states[row, h + 1, slope : slope + wide]
            for k in range(wide):
                inner[k] = score[row, h, k] - evident
    best = np.full((high + 2, stride), np.float32(-np.inf), dtype=np.float32)
    moved = np.empty_like(best)
    for row in range(1, rows):
        for h in range(1, high + 1):
            for k in range(stride):
                beside = max(states[row - 1, h - 1, k], states[row - 1, h + 1, k]) - widen
                best[h, k] = max(beside, states[row - 1, h, k])
        for _ in range(slope):
            for h in range(1, high + 1):
                for k in range(1, stride - 1):
                    beside = max(best[h, k - 1], best[h, k + 1]) - move
                    moved[h, k] = max(best[h, k], beside)
            for h in range(1, high + 1):
                for k in range(1, stride - 1):
                    best[h, k] = moved[h, k]
        for h in range(1, high + 1):
            for k in range(stride):
                states[row, h, k] += max(best[h, k], np.float32(0))
    return states


def walked_back(states: Floats, end: int, moves: Rows, costs: Floats) -> Rows:
    """As `band._walked_back`."""
    found = np.empty(len(states), dtype=np.int64)
    found[0] = end
    count = 1
    for row in range(len(states) - 2, -1, -1):
        best, most = 0, np.float32(-np.inf)
        for one in range(len(moves)):
            value = states[row, found[count - 1] - moves[one]] - costs[one]
            if value > most:
                best, most = one, value
        if most <= 0:
            break
        found[count] = found[count - 1] - moves[best]
        count += 1
    return found[:count]


def evident(change: Floats, mean: Floats, square: Floats, floor: np.float32) -> Floats:
    """As `band._evident`."""
    planes, rows, columns = change.shape
    found = np.zeros((rows, columns), dtype=np.float32)
    none, quarter, half_at = np.float32(0), np.float32(0.25), np.float32(1.5)
    for row in range(rows):
        for plane in range(planes):
            for k in range(columns):
                moved = change[plane, row, k] * change[plane, row, k]
                own = mean[plane, row, k]
                spread = square[plane, row, k] - own * own - moved * quarter
                found[row, k] += moved / (max(spread, none) + floor)
        for k in range(columns):
            found[row, k] = found[row, k] / (found[row, k] + half_at)
    return found


def contrasted(
    sums: Floats, known: Floats, start: int, count: int, half: int, floor: np.float32
) -> tuple[Floats, Floats]:
    """As `band._contrasted`."""
    _, features, rows, _ = sums.shape
    contrast = np.zeros((rows, count), dtype=np.float32)
    rougher = np.empty((rows, count), dtype=np.float32)
    far_left, left, right, far_right = (
        start - 3 * half,
        start - half,
        start + half,
        start + 3 * half,
    )
    own = known[right : right + count] - known[left : left + count]
    one, none = np.float32(1), np.float32(0)
    rest, beyond_left, beyond_right = np.empty_like(own), np.empty_like(own), np.empty_like(own)
    for at in range(count):
        whole = known[far_right + at] - known[far_left + at]
        rest[at] = one / max(whole - own[at], one)
        beyond_left[at] = one / max(known[left + at] - known[far_left + at], one)
        beyond_right[at] = one / max(known[far_right + at] - known[right + at], one)
        own[at] = one / own[at]
    for row in range(rows):
        for feature in range(features):
            a0 = sums[0, feature, row, far_left : far_left + count]
            a1 = sums[0, feature, row, left : left + count]
            a2 = sums[0, feature, row, right : right + count]
            a3 = sums[0, feature, row, far_right : far_right + count]
            b0 = sums[1, feature, row, far_left : far_left + count]
            b1 = sums[1, feature, row, left : left + count]
            b2 = sums[1, feature, row, right : right + count]
            b3 = sums[1, feature, row, far_right : far_right + count]
            for at in range(count):
                inside, square = a2[at] - a1[at], b2[at] - b1[at]
                around = ((a3[at] - a0[at]) - inside) * rest[at]
                square_around = ((b3[at] - b0[at]) - square) * rest[at]
                inside, square = inside * own[at], square * own[at]
                spread = square + square_around - inside * inside - around * around
                change = (inside - around) * (inside - around)
                contrast[row, at] += change / (max(spread, none) + floor)
        for at in range(count):
            value = contrast[row, at]
            contrast[row, at] = value / (value + one)
            beside = max((a1[at] - a0[at]) * beyond_left[at], (a3[at] - a2[at]) * beyond_right[at])
            rougher[row, at] = max((a2[at] - a1[at]) * own[at] - beside, none)
    return contrast, rougher


def counted(
    looks: Rows, first: Rows, end: Rows, valid: NDArray[np.bool_], bins: int
) -> NDArray[np.int64]:
    """As `zones.Looks.shares` counts: each look in the columns [first, end) that are valid."""
    rows, columns = valid.shape
    found = np.zeros(bins, dtype=np.int64)
    for row in range(rows):
        for column in range(max(first[row], 0), min(end[row], columns)):
            if valid[row, column]:
                found[looks[row * columns + column]] += 1
    return found


def looked_up(
    colours: Rows, texture: Rows, by_colour: Floats, by_texture: Floats, most: np.float32
) -> Floats:
    """As `zones._looked_up`."""
    found = np.empty(len(colours), dtype=np.float32)
    for place in range(len(colours)):
        value = by_colour[colours[place]] + by_texture[texture[place]]
        found[place] = min(max(value, -most), most)
    return found


def scored(
    like: Floats,
    edges: Floats,
    toe: NDArray[np.float64],
    start: int,
    columns: int,
    reach: float,
    gain: np.float32,
    weight: np.float32,
) -> Floats:
    """As `toes._score`."""
    rows = len(toe)
    found = np.empty((rows, columns), dtype=np.float32)
    for row in range(rows):
        total, most = np.float32(0), np.float32(-np.inf)
        for column in range(columns):
            total += like[row, start + column]
            value = total * gain + weight * edges[row, start + column]
            if not abs(start + column - toe[row]) <= reach:
                value = np.float32(-1e6)
            found[row, column] = value
            most = max(most, value)
        for column in range(columns):
            found[row, column] -= most
    return found


def moved(profiles: NDArray[Any], shift: NDArray[np.float64]) -> NDArray[Any]:
    """As `edge_model.moved`."""
    rows, count = profiles.shape
    found = np.empty_like(profiles)
    part = np.empty(1, dtype=profiles.dtype)
    for row in range(rows):
        whole = np.floor(shift[row])
        first, part[0] = int(whole), shift[row] - whole
        for column in range(count):
            low = profiles[row, min(max(column + first, 0), count - 1)]
            high = profiles[row, min(max(column + first + 1, 0), count - 1)]
            found[row, column] = low + part[0] * (high - low)
    return found


def profiles(signal: Floats, centre: Rows, outside: int, size: int) -> Floats:
    """As `edge_model._profiles`, of a signal (stack, rows, columns)."""
    stack, rows, columns = signal.shape
    found = np.empty((stack, rows, size), dtype=np.float32)
    for one in range(stack):
        for row in range(rows):
            first = centre[row] - outside
            for k in range(size):
                found[one, row, k] = signal[one, row, min(max(first + k, 0), columns - 1)]
    return found


def vertices(
    values: NDArray[Any], shifts: NDArray[np.float64], power: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """As `edge_shapes._vertices_of`."""
    count, places = values.shape
    place, most, curvature = np.empty(count), np.empty(count), np.empty(count)
    step = shifts[1] - shifts[0]
    for one in range(count):
        at = 0
        for k in range(1, places):
            if values[one, k] > values[one, at]:
                at = k
        at = min(max(at, 1), places - 2)
        a, b = np.float64(values[one, at - 1]), np.float64(values[one, at])
        c = np.float64(values[one, at + 1])
        if power == 2:
            a, b, c = a * a, b * b, c * c
        bent = min(a - 2 * b + c, -1e-9)
        place[one] = shifts[at] + min(max(0.5 * (a - c) / bent, -1.0), 1.0) * step
        most[one], curvature[one] = b, bent
    return place, most, curvature
