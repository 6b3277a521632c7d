"""The webcam above the table: pictures of 640 x 480 pixels as it would send them."""

import cv2
import numpy as np

from .seam import TrueSeam
from .texture import Picture, Shades, blotches, rounded, sensor_noise
from .torch import TIP_COLUMN, TIP_ROW, arc_glow, draw_marker, hot_metal, torch_sprite
from .view import HEIGHT_PX, MARKER_X_MM, PX_FROM_MM, WIDTH_PX, px_of
from .vision import Scene
from .workpiece import MM_FROM_CANVAS, Workpiece

_NOISES = 6
_EXPOSURE_S = 0.02
_DIMMED = 0.5
"""Exposure while the arc burns, as a share of the one without it."""


class Camera:
    """Renders scenes in the order of time; the bead grows on its workpiece meanwhile."""

    def __init__(self, seam: TrueSeam, rng: np.random.Generator) -> None:
        self._rng = rng
        self._workpiece = Workpiece(seam, rng)
        self._shading = _shading(rng)
        shape = (HEIGHT_PX, WIDTH_PX)
        self._noises = [sensor_noise(rng, shape) for _ in range(_NOISES)]
        self._torch, self._cover = torch_sprite()
        self._glow = arc_glow(HEIGHT_PX, WIDTH_PX)
        self._smoke = 26.0 * np.clip(blotches(rng, (HEIGHT_PX, 2 * WIDTH_PX), 60.0), 0.0, 2.0)
        self._hot = hot_metal()
        self._exposure = 1.0
        self._arc_seen_s: float | None = None
        self._last: tuple[float, float] | None = None

    def picture(self, scene: Scene) -> Picture:
        """The picture of `scene`, BGR, shape (480, 640, 3)."""
        if scene.arc_on:
            place = -scene.travel_mm
            self._workpiece.deposit(place, scene.torch_y_mm, 6.4)
            self._arc_seen_s = scene.time_s
        self._exposure += 0.45 * ((_DIMMED if scene.arc_on else 1.0) - self._exposure)
        picture = self._seen_workpiece(scene)
        self._add_torch(picture, scene)
        if scene.arc_on:
            self._add_arc(picture, scene)
        else:
            self._add_afterglow(picture, scene)
        noise = self._noises[int(self._rng.integers(_NOISES))]
        noise = np.roll(noise, int(self._rng.integers(HEIGHT_PX)), axis=0)
        return np.asarray(cv2.add(picture, noise, dtype=cv2.CV_8U), dtype=np.uint8)

    def _seen_workpiece(self, scene: Scene) -> Picture:
        moved = np.array(
            [[1.0, 0.0, scene.travel_mm + scene.slip_mm], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        )
        canvas_to_px = PX_FROM_MM @ moved @ MM_FROM_CANVAS
        size = (WIDTH_PX, HEIGHT_PX)
        seen = cv2.warpPerspective(
            self._workpiece.canvas, canvas_to_px, size, flags=cv2.INTER_LINEAR
        )
        blur_px = self._motion_px(scene)
        if blur_px > 1:
            seen = cv2.blur(seen, (1, blur_px))
        return np.asarray(cv2.multiply(seen, self._shading, scale=self._exposure / 200.0))

    def _motion_px(self, scene: Scene) -> int:
        last, self._last = self._last, (scene.time_s, scene.travel_mm)
        if last is None:
            return 1
        speed_mm_s = (scene.travel_mm - last[1]) / (scene.time_s - last[0])
        return round(abs(speed_mm_s) * _EXPOSURE_S / 0.42)

    def _add_torch(self, picture: Picture, scene: Scene) -> None:
        column, row = px_of(0.0, scene.torch_y_mm)[0]
        left, top = int(np.floor(column)) - TIP_COLUMN, int(np.floor(row)) - TIP_ROW
        rows = slice(max(top, 0), min(top + self._torch.shape[0], HEIGHT_PX))
        columns = slice(max(left, 0), min(left + self._torch.shape[1], WIDTH_PX))
        part = (
            slice(rows.start - top, rows.stop - top),
            slice(columns.start - left, columns.stop - left),
        )
        cover = self._cover[part]
        area = picture[rows, columns]
        light = self._torch[part] * (0.35 + 0.65 * self._exposure)
        area[:] = rounded(cover * light + (1.0 - cover) * area)
        marker = px_of(MARKER_X_MM, scene.torch_y_mm)[0]
        draw_marker(picture, float(marker[0]), float(marker[1]))

    def _add_arc(self, picture: Picture, scene: Scene) -> None:
        column, row = px_of(0.0, scene.torch_y_mm)[0]
        top, left = HEIGHT_PX - round(row) - 3, WIDTH_PX - round(column)
        glow = self._glow[top : top + HEIGHT_PX, left : left + WIDTH_PX]
        flicker = float(self._rng.uniform(0.8, 1.12)) * (0.6 + 0.8 * self._exposure)
        cv2.addWeighted(picture, 1.0, glow, flicker, 0.0, dst=picture)
        self._add_smoke(picture, column, row, scene.time_s)
        self._add_sparks(picture, column, row)

    def _add_smoke(self, picture: Picture, column: float, row: float, time_s: float) -> None:
        drift = round(90.0 * time_s) % WIDTH_PX
        top, left = max(0, round(row) - 190), max(0, round(column) - 110)
        area = picture[top : round(row), left : left + 220]
        rows, columns = area.shape[:2]
        veil = self._smoke[top : top + rows, drift : drift + columns] * _PLUME[-rows:, :columns]
        area[:] = rounded(area + veil[..., None].astype(np.float32))

    def _add_sparks(self, picture: Picture, column: float, row: float) -> None:
        for _ in range(int(self._rng.poisson(5.0))):
            angle, near = self._rng.uniform(0.0, 2.0 * np.pi), self._rng.exponential(26.0) + 9.0
            length = self._rng.uniform(2.0, 9.0)
            steps = np.array([near, near + length])
            x, y = column + steps * np.cos(angle), row + 0.7 * steps * np.sin(angle)
            ends = [(round(16 * float(a)), round(16 * float(b))) for a, b in zip(x, y, strict=True)]
            cv2.line(picture, ends[0], ends[1], (165, 222, 255), 1, cv2.LINE_AA, 4)

    def _add_afterglow(self, picture: Picture, scene: Scene) -> None:
        if self._arc_seen_s is None or scene.time_s - self._arc_seen_s > 4.0:
            return
        strength = float(np.exp(-(scene.time_s - self._arc_seen_s) / 0.7))
        column, row = (round(float(v)) for v in px_of(0.0, scene.bead_end_mm)[0])
        rows, columns = self._hot.shape[0] // 2, self._hot.shape[1] // 2
        area = picture[row - rows : row + rows, max(0, column - columns) : column + columns]
        glow = self._hot[: area.shape[0], -area.shape[1] :]
        area[:] = rounded(area + strength * glow)


def _plume() -> Shades:
    y, x = np.mgrid[-190:0, -110:110].astype(np.float32)
    rise = np.exp(-((x - 0.25 * y) ** 2) / (2.0 * (14.0 - 0.22 * y) ** 2)) * np.exp(y / 95.0)
    return np.asarray(rise, dtype=np.float32)


_PLUME = _plume()


def _shading(rng: np.random.Generator) -> Picture:
    """Vignetting and a lamp at the upper right; 200 means unchanged."""
    y, x = np.mgrid[-1.0 : 1.0 : HEIGHT_PX * 1j, -1.0 : 1.0 : WIDTH_PX * 1j]
    lamp = 1.06 + 0.13 * x - 0.10 * y
    vignette = 1.0 - 0.24 * (x**2 + y**2) / 2.0 - 0.10 * ((x**2 + y**2) / 2.0) ** 2
    field = 200.0 * lamp * vignette + 1.0 * blotches(rng, (HEIGHT_PX, WIDTH_PX), 160.0)
    return np.repeat(rounded(field.astype(np.float32))[..., None], 3, axis=-1)
