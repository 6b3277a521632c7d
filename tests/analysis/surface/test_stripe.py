"""Laser stripes: found past ghosts, turned into heights, refused where there is nothing to see."""

from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.calibration.laser import calibrate_laser
from seamlog.analysis.surface.heights import CALIBRATION, heights_part
from seamlog.analysis.surface.profile import profile_figures
from seamlog.analysis.surface.stripe import find_stripe
from seamlog.analysis.surface.synthetic_stripe import (
    HEIGHT_MM,
    MM_PER_PX,
    ROW_OF_ZERO,
    STEP_MM,
    UNDERCUT_MM,
    WIDTH_MM,
    stripe_frame,
    true_z_mm,
)
from seamlog.calibration import PlaneCalibration, rows_of
from seamlog.errors import EvidenceError, UsageError
from seamlog.mcap.attachments import Attachment
from seamlog.recorder import Recorder
from seamlog.session import open_session

X_MM = np.arange(-20.0, 20.0, 0.05)


def test_the_stripe_is_found_past_ghosts_and_gleams() -> None:
    errors = []
    for seed in range(4):
        frame, true_row = stripe_frame(seed)
        found = find_stripe(frame)
        assert found.seen.mean() > 0.95
        error_um = 1e3 * MM_PER_PX * (found.px[:, 1] - true_row)[found.seen]
        errors.append(np.sqrt(np.mean(error_um**2)))
    assert np.mean(errors) < 30
    plain, true_row = stripe_frame(0, ghosts=False)
    error_um = 1e3 * MM_PER_PX * (find_stripe(plain).px[:, 1] - true_row)
    assert np.sqrt(np.mean(error_um**2)) < 5


def test_a_stripe_from_top_to_bottom() -> None:
    frame, true_row = stripe_frame(1, ghosts=False)
    found = find_stripe(np.ascontiguousarray(frame.T))
    assert np.abs(found.px[:, 0] - true_row).max() < 1.0
    assert (found.px[:, 1] == np.arange(len(true_row))).all()


def test_columns_without_light_are_not_seen() -> None:
    frame, _ = stripe_frame(3, ghosts=False)
    frame[:, 300:420] = 12
    found = find_stripe(frame)
    assert not found.seen[305:415].any()
    assert found.seen[:295].all()


@pytest.mark.parametrize("dark", [True, False])
def test_a_frame_without_stripe_is_refused(dark: bool) -> None:
    noise = np.random.default_rng(0).integers(0, 60, (300, 400), np.uint8)
    with pytest.raises(EvidenceError, match=r"frame 7.*no laser stripe"):
        find_stripe(np.full((300, 400), 30, np.uint8) if dark else noise, "frame 7")


def test_figures_of_a_profile() -> None:
    z_mm = true_z_mm(X_MM) + 0.005 * np.random.default_rng(0).standard_normal(len(X_MM))
    found = profile_figures(X_MM, z_mm)
    assert found.height_mm == pytest.approx(HEIGHT_MM, abs=0.02)
    assert found.width_mm == pytest.approx(WIDTH_MM, abs=0.3)
    assert found.undercut_mm == pytest.approx(UNDERCUT_MM, abs=0.05)
    assert found.misalignment_mm == pytest.approx(STEP_MM, abs=0.02)
    steep = 180 - np.degrees(np.arctan(2 * HEIGHT_MM / (WIDTH_MM / 2)))
    assert found.toe_angles_deg == pytest.approx((steep, steep), abs=7)
    assert 0 < found.u_height_mm < 0.02


def test_no_undercut_is_zero_and_holes_do_not_matter() -> None:
    z_mm = true_z_mm(X_MM, undercut_mm=0.0)
    z_mm += 0.005 * np.random.default_rng(1).standard_normal(len(X_MM))
    z_mm[300:330] = np.nan
    found = profile_figures(X_MM[::-1], z_mm[::-1])
    assert found.undercut_mm == 0
    assert found.height_mm == pytest.approx(HEIGHT_MM, abs=0.02)


def test_profiles_that_show_no_bead_are_refused() -> None:
    rng = np.random.default_rng(2)
    with pytest.raises(EvidenceError, match="no bead"):
        profile_figures(X_MM, 0.1 * X_MM + 0.02 * rng.standard_normal(len(X_MM)))
    with pytest.raises(EvidenceError, match="too short"):
        profile_figures(X_MM[:10], true_z_mm(X_MM[:10]))
    with pytest.raises(EvidenceError):
        profile_figures(X_MM, np.full(len(X_MM), np.nan))


def laser_plane() -> PlaneCalibration:
    matrix = np.array([[MM_PER_PX, 0, -20.0], [0, -MM_PER_PX, ROW_OF_ZERO * 20], [0, 0, 1]])
    return PlaneCalibration(
        image_width_px=800,
        image_height_px=400,
        plane_mm_from_px=rows_of(matrix),
        residual_mm=0.005,
        scale_relative_u=0.002,
        frame="laser",
    )


def test_a_light_plane_from_steps() -> None:
    truth = laser_plane()
    px = np.array([[100.0, 300], [700, 300], [100, 200], [700, 200], [400, 120], [400, 320]])
    found = calibrate_laser(px, truth.plane_mm(px), (800, 400))
    assert found.frame == "laser"
    assert found.plane_mm(px + 20) == pytest.approx(truth.plane_mm(px + 20), abs=1e-3)
    with pytest.raises(EvidenceError, match="one line"):
        calibrate_laser(px[[0, 1, 0, 1]], truth.plane_mm(px[[0, 1, 0, 1]]), (800, 400))
    with pytest.raises(UsageError, match="4 or more"):
        calibrate_laser(px[:3], truth.plane_mm(px[:3]), (800, 400))


def recorded(path: Path, topic: str) -> None:
    """A session of two stripes, as frames or as profiles."""
    with Recorder(path) as recorder:
        for seed in range(2):
            stamp = 1_700_000_000_000_000_000 + seed * 10**8
            if topic == "/camera/stripe":
                recorder.log_frame(topic, stripe_frame(seed)[0], stamp)
            else:
                z_m = 1e-3 * true_z_mm(X_MM)
                recorder.log(topic, stamp, x_m=1e-3 * X_MM, z_m=z_m)


def test_frames_of_a_session(tmp_path: Path) -> None:
    from seamlog.commands.attach import rewrite

    path = tmp_path / "weld.mcap"
    recorded(path, "/camera/stripe")
    with open_session(path) as session:
        found = heights_part(session)
        assert found is not None
        assert found[0].figure("height_mm").value is None  # type: ignore[union-attr]
        assert "calibrate laser" in found[0].figure("height_mm").reason  # type: ignore[union-attr]
        data = laser_plane().model_dump_json(by_alias=True).encode()
        rewrite(session, [Attachment(CALIBRATION, "application/json", 1, data, 1)])
    with open_session(path) as session:
        part, tables, pictures = heights_part(session) or pytest.fail("no part")
    values = {figure.name: figure.value for figure in part.figures}
    assert values["profiles"] == 2
    assert values["height_mm"] == pytest.approx(HEIGHT_MM, abs=0.05)
    assert values["misalignment_mm"] == pytest.approx(STEP_MM, abs=0.05)
    assert len(tables["profiles"][0]["stamp_ns"]) == 2
    assert set(pictures) == {"stripe"}


def test_profiles_of_a_session(tmp_path: Path) -> None:
    path = tmp_path / "weld.mcap"
    recorded(path, "/seam/profile")
    with open_session(path) as session:
        part, tables, _ = heights_part(session) or pytest.fail("no part")
    assert part.figure("undercut_depth_mm").value == pytest.approx(UNDERCUT_MM, abs=0.04)  # type: ignore[union-attr]
    assert list(tables["profiles"][0]["height_mm"]) == pytest.approx([HEIGHT_MM] * 2, abs=0.02)
