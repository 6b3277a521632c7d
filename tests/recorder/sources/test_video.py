"""Video files become sessions with their own time stamps."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from seamlog import open_session
from seamlog.cli import run
from seamlog.clock import SIMULATED_EPOCH_NS
from seamlog.recorder.sources.video import _with_opencv

av = pytest.importorskip("av")
TIMES_MS = (0, 40, 80, 200, 240, 1000)
"""Not even: as a camera with a gap wrote them."""


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "seam.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for place, time_ms in enumerate(TIMES_MS):
            frame = av.VideoFrame.from_ndarray(
                np.full((48, 64, 3), 20 + 30 * place, np.uint8), "bgr24"
            )
            frame.pts, frame.time_base = time_ms, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def record(video: Path, session: Path, *options: str) -> int:
    path = f"source.path={video}"
    return run(["record", "--source", "video", "-o", str(session), "--set", path, *options])


def test_stamps_are_the_videos_own(tmp_path: Path, video: Path) -> None:
    session = tmp_path / "weld.mcap"
    assert record(video, session) == 0
    with open_session(session) as opened:
        columns = opened.columns("/camera/image", ["stamp_ns"])
        frames = opened.frames()
        levels = [float(frames[place].image().mean()) for place in range(len(TIMES_MS))]
    apart_ms = (columns["stamp_ns"] - columns["stamp_ns"][0]) / 1e6
    np.testing.assert_allclose(apart_ms, TIMES_MS)
    assert columns["stamp_ns"][0] == SIMULATED_EPOCH_NS
    np.testing.assert_allclose(levels, [20 + 30 * place for place in range(6)], atol=4)
    assert columns["log_time_ns"].tolist() == columns["stamp_ns"].tolist()


def test_the_start_may_be_given(tmp_path: Path, video: Path) -> None:
    session = tmp_path / "weld.mcap"
    start = "source.start=2026-11-25T08:00:00+01:00"
    assert record(video, session, "--set", start, "--set", "source.grey=true") == 0
    with open_session(session) as opened:
        assert opened.columns("/camera/image")["stamp_ns"][0] == 1_795_590_000_000_000_000
        assert opened.frames()[0].image().shape[:2] == (48, 64)


def test_opencv_tells_the_same_times(video: Path) -> None:
    times = [time_ns / 1e6 for time_ns, _, _ in _with_opencv(video, False)]
    np.testing.assert_allclose(times, TIMES_MS, atol=0.01)


def test_what_is_no_video(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.mp4").write_bytes(b"no video at all" * 100)
    assert record(tmp_path / "a.mp4", tmp_path / "weld.mcap") == 3
    assert "cannot be decoded" in capsys.readouterr().err
    assert record(tmp_path / "none.mp4", tmp_path / "weld.mcap") == 3
    assert list(tmp_path.glob("*.mcap*")) == []
