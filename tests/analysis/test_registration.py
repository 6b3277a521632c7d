"""Photo and torch path: tied by the table frame, by the ends, by the shape, or refused."""

from dataclasses import replace

import numpy as np
import pytest

from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane
from seamlog.analysis.bead.stitch import backwards
from seamlog.analysis.registration import tie_bead
from seamlog.analysis.torch_path import TorchPath
from seamlog.errors import EvidenceError
from tests.analysis.test_join import bead as straight_bead

Y = np.arange(0.0, 200.01, 0.5)
CAP_MM = 3.0


def curved(y: np.ndarray, lean: float = 8.0) -> np.ndarray:
    """A path that is not the same from its other end."""
    return np.asarray(lean * np.sin(2 * np.pi * y / 150) * np.exp(-y / 120))


def torch(x: np.ndarray, u_s_mm: float = 0.3) -> TorchPath:
    s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(Y)))])
    stamp = np.arange(len(Y), dtype=np.int64) * 80_000_000
    speed = np.full(len(Y), 6.0)
    return TorchPath(stamp, s, speed, u_s_mm, 0.02, np.column_stack([x, Y]))


def photographed(
    x: np.ndarray, plane: Plane, noise_mm: float = 0.05, window: tuple[float, float] = (-9, 999)
) -> BeadMeasurement:
    """The bead on that path, 3 mm longer at both ends, as a photo with `plane` shows it."""
    y = np.arange(-CAP_MM, 200 + CAP_MM, 0.25)
    places = np.column_stack([np.interp(y, Y, x), y])
    places[:, 0] += noise_mm * np.random.default_rng(1).standard_normal(len(y))
    places = places[(y >= window[0]) & (y <= window[1])]
    smooth = np.column_stack([np.interp(y, Y, x), y])[(y >= window[0]) & (y <= window[1])]
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(smooth, axis=0).T))])
    px = plane.to_px(places)
    count = len(s)
    return replace(
        straight_bead(),
        s=s,
        width=np.full(count, 6.0),
        u_width=np.full(count, 0.05),
        u_noise=np.full(count, 0.03),
        left_px=px,
        right_px=px,
        centre_px=px,
        flagged=np.zeros(count, dtype=bool),
        reason=("",) * count,
        direction_known=False,
        open_start=window[0] > -CAP_MM,
        open_stop=window[1] < 200,
    )


def plane_turned(degrees: float, in_table_frame: bool = False) -> Plane:
    """A photo from above, 0.1 mm a px: y runs upwards in it, turned by `degrees`."""
    turn = np.radians(degrees)
    rotation = np.array(
        [[np.cos(turn), -np.sin(turn), 40], [np.sin(turn), np.cos(turn), -25], [0, 0, 1]]
    )
    from_px = np.array([[0.1, 0, -100.0], [0, -0.1, 210.0], [0, 0, 1]])
    matrix = from_px if in_table_frame else rotation @ from_px
    return Plane(matrix, "mm", 0.0, 0.01, in_table_frame, frame_u=0.2)


@pytest.mark.parametrize("degrees", [0.0, 35.0, 170.0])
@pytest.mark.parametrize("turned", [False, True])
def test_the_shape_tells_direction_and_place(degrees: float, turned: bool) -> None:
    plane = plane_turned(degrees)
    bead = photographed(curved(Y), plane)
    tie = tie_bead(backwards(bead) if turned else bead, torch(curved(Y)), plane)
    assert tie.backwards is turned
    assert tie.offset_mm == pytest.approx(CAP_MM, abs=1.0)
    assert tie.u_s_mm < 2
    assert "shape" in tie.method


def test_a_mirrored_calibration_tells_the_same() -> None:
    """A left-handed plane (y down, as pictures have it) is turned over, not taken as a mirror."""
    plane = plane_turned(0.0)
    bead = photographed(curved(Y), plane)
    left_handed = replace(plane, plane_from_px=np.diag([1.0, -1.0, 1.0]) @ plane.plane_from_px)
    tie = tie_bead(bead, torch(curved(Y)), left_handed)
    assert not tie.backwards
    assert tie.offset_mm == pytest.approx(CAP_MM, abs=1.0)


def test_a_part_of_the_bead_is_placed_by_its_shape() -> None:
    plane = plane_turned(20.0)
    bead = photographed(curved(Y), plane, window=(20.0, 170.0))
    tie = tie_bead(bead, torch(curved(Y)), plane)
    start_s = np.interp(20.0, Y, torch(curved(Y)).s_mm)
    assert tie.offset_mm == pytest.approx(-start_s, abs=3 * tie.u_s_mm)


@pytest.mark.parametrize(
    "x", [np.zeros_like(Y), 6 * np.sin(2 * np.pi * (Y - 100) / 200)], ids=["straight", "S"]
)
def test_a_path_that_is_the_same_from_both_ends_is_ambiguous(x: np.ndarray) -> None:
    plane = plane_turned(10.0)
    with pytest.raises(EvidenceError, match=r"ambiguous.*--start"):
        tie_bead(photographed(x, plane), torch(x), plane)


def test_another_weld_is_refused() -> None:
    plane = plane_turned(0.0)
    other = 30 * np.exp(-(((Y - 60) / 30) ** 2))
    with pytest.raises(EvidenceError, match=r"ambiguous|does not fit"):
        tie_bead(photographed(other, plane), torch(-curved(Y)), plane)


def test_the_table_frame_comes_first() -> None:
    """The marker sits 34 mm beside the torch, which the bead itself shows."""
    plane = plane_turned(0.0, in_table_frame=True)
    for turned in (False, True):
        bead = photographed(curved(Y), plane)
        seen = backwards(bead) if turned else bead
        tie = tie_bead(seen, torch(curved(Y) - 34.0), plane)
        assert tie.backwards is turned
        assert tie.offset_mm == pytest.approx(CAP_MM, abs=0.3)
        assert tie.u_s_mm == pytest.approx(np.hypot(0.3, 0.2), abs=0.2)
        assert "table frame" in tie.method


def test_a_photo_elsewhere_on_the_table_is_refused() -> None:
    plane = plane_turned(0.0, in_table_frame=True)
    bead = photographed(curved(Y), plane)
    away = torch(curved(Y))
    moved = replace(away, path_mm=away.path_mm + np.array([0.0, 400.0]))
    with pytest.raises(EvidenceError, match="off the torch's path"):
        tie_bead(bead, moved, plane)
    said = replace(backwards(bead), direction_known=True)
    with pytest.raises(EvidenceError, match="--start"):
        tie_bead(said, away, plane)
