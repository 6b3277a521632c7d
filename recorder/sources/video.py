"""The source `video`: frames of a video file with the file's own time stamps."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import AwareDatetime, BaseModel, ConfigDict

from seamlog.clock import SIMULATED_EPOCH_NS, SimulatedClock
from seamlog.contracts import Pace, Sink, SourceResult
from seamlog.errors import ImportFailed

from .camera import TOPIC
from .drivers import VIDEO, Driver


class VideoConfig(BaseModel):
    """Which file, and when it began."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    path: Path
    start: AwareDatetime | None = None
    """Time of its first frame, with zone; else what the file says, else 2026-01-01."""
    grey: bool = False


class VideoFile:
    """Logs all frames, as fast as they decode unless paced; PyAV decodes, else OpenCV."""

    Config = VideoConfig
    pace: Pace = "simulated"
    drivers = (Driver("cv2", "opencv-python-headless", ""),)

    def __init__(self, config: VideoConfig) -> None:
        self.config = config
        self.clock = SimulatedClock(0)

    def run(self, sink: Sink) -> SourceResult:
        """Log to the end of the file; `ImportFailed` if it cannot be read."""
        path = self.config.path
        with path.open("rb"):
            pass
        decode = _with_av if VIDEO.is_installed else _with_opencv
        sink.channel(TOPIC, {"device": path.name})
        count, start_ns = 0, 0
        for time_ns, image, created in decode(path, self.config.grey):
            if not count:
                start_ns = _start_ns(self.config.start or created) - time_ns
            stamp_ns = start_ns + time_ns
            self.clock.advance_to(max(stamp_ns, self.clock.now_ns()))
            sink.log_frame(TOPIC, image, stamp_ns)
            count += 1
        if not count:
            raise ImportFailed(f"{path} holds no frame that decodes; is it a video?")
        return SourceResult()


def _start_ns(start: datetime | None) -> int:
    if start is None:
        return SIMULATED_EPOCH_NS
    since = start - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000


def _with_av(path: Path, grey: bool) -> Iterator[tuple[int, Any, datetime | None]]:
    av = VIDEO.load()
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise ImportFailed(f"{path} has no video stream")
            stream = container.streams.video[0]
            created = _created(container.metadata | stream.metadata)
            for place, frame in enumerate(container.decode(stream)):
                pts = place if frame.pts is None else frame.pts
                time_ns = round(pts * frame.time_base * 1_000_000_000)
                yield time_ns, frame.to_ndarray(format="gray" if grey else "bgr24"), created
    except av.error.FFmpegError as error:
        raise ImportFailed(f"{path} cannot be decoded as video: {error}") from error


def _created(metadata: dict[str, str]) -> datetime | None:
    try:
        return datetime.fromisoformat(metadata.get("creation_time", "")).astimezone(UTC)
    except ValueError:
        return None


def _with_opencv(path: Path, grey: bool) -> Iterator[tuple[int, Any, datetime | None]]:
    import cv2

    video = cv2.VideoCapture(str(path))
    try:
        while video.grab():
            # Behind grab() OpenCV tells the time of the frame that it took.
            time_ns = round(video.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
            whole, image = video.retrieve()
            if not whole:
                break
            yield time_ns, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if grey else image, None
    finally:
        video.release()
