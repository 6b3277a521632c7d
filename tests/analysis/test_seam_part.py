"""Part `seam`: pictures of the weld at their moments, and what the camera found."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog import open_session
from seamlog.analysis.seam_part import MOST_PICTURES, WIDEST_PX, seam_part
from seamlog.channels import CHANNELS
from seamlog.clock import SIMULATED_EPOCH_NS, SimulatedClock
from seamlog.mcap.batch import BatchWriter
from seamlog.recorder import Recorder
from seamlog.results import Results

FRAMES, STEP_NS = 150, 100_000_000


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """150 pictures whose grey value is their number, seam points in all but ten, one weld."""
    path = tmp_path_factory.mktemp("seam") / "session.mcap"
    clock = SimulatedClock()
    with Recorder(path, pace="simulated", clock=clock) as recorder:
        for number in range(FRAMES):
            stamp_ns = SIMULATED_EPOCH_NS + number * STEP_NS
            clock.advance_to(stamp_ns)
            image = np.full((480, 640), number, np.uint8)
            recorder.log_frame("/camera/image", image, stamp_ns=stamp_ns)
            x = np.linspace(100.0, 500.0, 5) if number >= 10 else np.empty(0)
            recorder.log("/seam/points", stamp_ns=stamp_ns, x_px=x, y_px=np.full(len(x), 240.0))
            if number in (20, 139):
                recorder.log("/events", stamp_ns=stamp_ns, kind=1 if number == 20 else 2, detail="")
    return path


def test_pictures_are_of_the_weld_and_know_their_moment(session: Path, tmp_path: Path) -> None:
    with open_session(session) as opened:
        part, tables, pictures = seam_part(opened, opened.welds)
    whole = Results.create(tmp_path / "r").write(part, tables, pictures)
    assert len(whole.pictures) == MOST_PICTURES
    for name, picture in whole.pictures.items():
        assert picture.time_ns is not None
        number = (picture.time_ns - SIMULATED_EPOCH_NS) // STEP_NS
        assert 20 <= number <= 139
        assert (picture.width_px, picture.height_px) == (WIDEST_PX, 240)
        image = cv2.imdecode(np.frombuffer(pictures[name][0], np.uint8), cv2.IMREAD_COLOR)
        assert image is not None
        assert abs(float(np.median(image)) - number) < 4


def test_figures_count_what_the_camera_found(session: Path) -> None:
    with open_session(session) as opened:
        part, tables, _ = seam_part(opened, opened.welds)
    found = {figure.name: figure.value for figure in part.figures}
    assert (found["pictures"], found["pictures_with_seam"]) == (FRAMES, FRAMES - 10)
    length = part.figure("path_length_mm")
    assert length is not None and length.value is None and "/seam/path" in length.reason
    columns, _ = tables["vision"]
    assert columns["seam_points"].tolist() == [0.0] * 10 + [5.0] * (FRAMES - 10)


def test_a_session_without_a_camera_says_so(tmp_path: Path) -> None:
    stamps = SIMULATED_EPOCH_NS + np.arange(9) * STEP_NS
    with BatchWriter(tmp_path / "s.mcap") as writer:
        fields = {name: np.zeros(9) for name in CHANNELS["/table/encoder"].field_names[1:]}
        writer.write("/table/encoder", {"stamp_ns": stamps} | fields)
    with open_session(tmp_path / "s.mcap") as opened:
        part, tables, pictures = seam_part(opened, opened.welds)
    assert (tables, pictures) == ({}, {})
    counted = part.figure("pictures")
    assert counted is not None and counted.value is None and "/camera/image" in counted.reason
