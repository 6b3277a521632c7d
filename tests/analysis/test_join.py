"""Bead and log tied together: ties that hold, ties that are refused, and the virtual weld."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead_assess import bead_and_join
from seamlog.analysis.calibration.table import calibrate_table
from seamlog.analysis.join import thermal_efficiency
from seamlog.analysis.registration import tie_bead
from seamlog.analysis.torch_path import TorchPath
from seamlog.analysis.virtual_cell.bead_photo import _CORNERS_MM, _CORNERS_PX
from seamlog.calibration import PlaneCalibration, load_calibration, rows_of
from seamlog.cli import run
from seamlog.errors import EvidenceError
from seamlog.results import Verdict
from seamlog.session import Session, open_session


def torch(length_mm: float = 200.0, u_s_mm: float = 0.3) -> TorchPath:
    stamp_ns = np.arange(0, 34_000_000_000, 100_000_000)
    s_mm = np.linspace(0, length_mm, len(stamp_ns))
    return TorchPath(stamp_ns, s_mm, np.full(len(s_mm), 6.0), u_s_mm, 0.02)


def bead(length_mm: float = 206.0) -> BeadMeasurement:
    s = np.arange(0, length_mm + 0.1, 0.25)
    points = np.column_stack([10 * s, np.full(len(s), 50.0)])
    return BeadMeasurement(
        unit="mm",
        s=s,
        width=np.full(len(s), 6.0),
        u_width=np.full(len(s), 0.05),
        u_noise=np.full(len(s), 0.03),
        left_px=points,
        right_px=points,
        centre_px=points,
        flagged=np.zeros(len(s), dtype=bool),
        reason=("",) * len(s),
        unit_per_px=0.1,
        confidence=1.0,
        warnings=(),
        starts_at="left",
        direction_known=True,
        open_start=False,
        open_stop=False,
    )


def test_both_ends_tie_the_bead_in_its_middle() -> None:
    tie = tie_bead(bead(206), torch(200))
    assert tie.offset_mm == pytest.approx(3)
    assert tie.u_s_mm < 1.5
    assert "arc off" in tie.method


def test_the_start_alone_ties_a_bead_that_leaves_the_photo() -> None:
    tie = tie_bead(replace(bead(120), open_stop=True), torch(200))
    assert tie.offset_mm == pytest.approx(3)
    assert "arc off" not in tie.method


@pytest.mark.parametrize(
    ("measurement", "path", "reason"),
    [
        (replace(bead(), unit="px"), torch(), "no calibration"),
        (replace(bead(), direction_known=False), torch(), "--start"),
        (replace(bead(), open_start=True), torch(), "start of the bead is not in the photo"),
        (bead(250), torch(200), "belong together"),
        (bead(150), torch(200), "belong together"),
        (bead(), torch(u_s_mm=6.0), "5 mm are needed"),
    ],
)
def test_what_cannot_be_tied_is_refused(
    measurement: BeadMeasurement, path: TorchPath, reason: str
) -> None:
    with pytest.raises(EvidenceError, match=reason):
        tie_bead(measurement, path)


@pytest.fixture(scope="module")
def weld(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weld") / "weld.mcap"
    assert run(["record", "--source", "virtual-cell", "-o", str(path)]) == 0
    return path


@pytest.fixture
def session(weld: Path) -> Iterator[Session]:
    with open_session(weld) as opened:
        yield opened


def test_the_planted_cause_is_found(session: Session, weld: Path) -> None:
    photo = weld.with_name("weld.bead.jpg")
    parts = bead_and_join(session, session.welds, (photo,), "left")
    assert [part.part for part, _, _ in parts] == ["bead", "surface", "join"]
    (bead_part, _, _), _, (join, tables, _) = parts
    truth = json.loads(session.metadata["seamlog.truth"]["json"])
    planted, profile = truth["planted_cause"], truth["profile"]
    (cause,) = join.details["causes"]
    assert cause["channel"] == planted["channel"]
    assert cause["s_mm"] == pytest.approx(planted["s_mm"], abs=3)
    assert planted["start_ns"] < cause["stamp_ns"] < planted["end_ns"]
    assert "weld speed" in join.findings[0].message

    columns, units = tables["stations"]
    known = np.isfinite(columns["width_mm"])
    true_mm = np.interp(columns["s_mm"], profile["s_mm"], profile["width_mm"])
    error_mm = (columns["width_mm"] - true_mm)[known]
    assert np.sqrt(np.mean(error_mm**2)) < 0.2
    assert known.mean() > 0.9
    mean = bead_part.figure("width_mean_mm")
    assert mean is not None and isinstance(mean.value, float)
    assert mean.u is not None and mean.u < 0.15
    assert mean.value == pytest.approx(np.mean(true_mm[known]), abs=2 * mean.u)

    true_ns = np.interp(columns["s_mm"], profile["s_mm"], profile["time_ns"])
    assert np.abs(columns["stamp_ns"] - true_ns).max() < 0.5e9
    heat = 0.8 * columns["current_a"] * columns["voltage_v"] / columns["speed_mm_s"] / 1e3
    assert columns["heat_kj_mm"] == pytest.approx(heat, nan_ok=True)
    assert (units["heat_kj_mm"], units["command"]) == ("kJ/mm", "N")


def test_without_start_the_shape_of_the_path_tells_the_direction(
    session: Session, weld: Path, tmp_path: Path
) -> None:
    """The photo turned by half a turn: the weld now begins at its right."""
    picture = cv2.imread(str(weld.with_name("weld.bead.jpg")))
    turned = tmp_path / "turned.png"
    assert cv2.imwrite(str(turned), np.ascontiguousarray(np.asarray(picture)[::-1, ::-1]))
    calibration = load_calibration(weld.with_name("weld.bead.calibration.json"))
    assert isinstance(calibration, PlaneCalibration)
    size = (calibration.image_width_px - 1, calibration.image_height_px - 1)
    over = np.array([[-1.0, 0, size[0]], [0, -1.0, size[1]], [0, 0, 1]])
    moved = calibration.model_copy(
        update={"plane_mm_from_px": rows_of(calibration.matrix() @ over)}
    )
    turned.with_suffix(".calibration.json").write_text(moved.model_dump_json(by_alias=True))
    *_, (join, _, _) = bead_and_join(session, session.welds, (turned,))
    planted = json.loads(session.metadata["seamlog.truth"]["json"])["planted_cause"]
    assert join.details["backwards"] is True
    assert "shape" in join.details["method"]
    (cause,) = join.details["causes"]
    assert (cause["channel"], cause["s_mm"]) == (
        planted["channel"],
        pytest.approx(planted["s_mm"], abs=3),
    )


def test_a_bead_without_calibration_is_not_assessed(
    session: Session, weld: Path, tmp_path: Path
) -> None:
    photo = tmp_path / "alone.jpg"
    photo.write_bytes(weld.with_name("weld.bead.jpg").read_bytes())
    *_, (join, tables, _) = bead_and_join(session, session.welds, (photo,))
    assert (join.part, join.verdict) == ("join", Verdict.NOT_ASSESSED)
    assert "no calibration" in join.reason
    assert not tables
    assert join.details["causes"] == []


def test_without_photos_there_is_no_bead(session: Session) -> None:
    assert bead_and_join(session, session.welds) == []


def test_a_photo_in_the_table_frame_is_searched_along_the_logged_seam(
    session: Session, weld: Path, tmp_path: Path
) -> None:
    """The same photo, its plane tied to the table by three points of known place."""
    photo = tmp_path / "tied.jpg"
    photo.write_bytes(weld.with_name("weld.bead.jpg").read_bytes())
    plane = load_calibration(weld.with_name("weld.bead.calibration.json"))
    assert isinstance(plane, PlaneCalibration)
    px, mm = np.array(_CORNERS_PX), np.array(_CORNERS_MM)
    tied = calibrate_table(plane, px, mm).calibration
    photo.with_suffix(".calibration.json").write_text(tied.model_dump_json(by_alias=True))
    *_, (join, tables, _) = bead_and_join(session, session.welds, (photo,))
    assert "table frame" in join.details["method"]
    assert join.details["u_s_mm"] < 1
    assert join.details["causes"][0]["channel"] == "weld_speed"
    closest = tables["correlations"][0]["channel"][0]
    assert closest == "weld speed"


@pytest.mark.parametrize(
    ("process", "efficiency", "known"),
    [
        ("135 MAG", 0.8, True),
        ("141", 0.6, True),
        ("121", 1.0, True),
        ("MAG welding, short arc (ISO 4063: 135-D)", 0.8, True),
        ("brazing", 0.8, False),
        ("", 0.8, False),
    ],
)
def test_thermal_efficiency_goes_by_the_process(
    process: str, efficiency: float, known: bool
) -> None:
    assert thermal_efficiency(process) == (efficiency, known)
