"""The source `camera`: what OpenCV opens, a V4L2 device or the address of a network camera."""

import os
import time
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from seamlog.channels import EVENT_KINDS
from seamlog.clock import MonotonicClock
from seamlog.contracts import Device, Pace, Sink, SourceResult
from seamlog.errors import SourceMissing

from .drivers import Driver

TOPIC = "/camera/image"
_REOPEN_S = 0.5
_FRESH_NS = 1_000_000_000


class CameraConfig(BaseModel):
    """Which camera and how it is set; what is not given stays as the driver has it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    device: int | str = 0
    """Number of a V4L2 device, its path, or an address such as rtsp://... or http://.../mjpeg."""
    width_px: int | None = Field(None, ge=16, le=16_384)
    height_px: int | None = Field(None, ge=16, le=16_384)
    rate_hz: float | None = Field(None, gt=0, le=10_000)
    pixel_format: str | None = Field(None, pattern="^[ -~]{4}$")
    """Four characters, such as MJPG or YUYV."""
    exposure: float | None = None
    """In the driver's own unit, automatic exposure off."""
    grey: bool = False
    """Keep brightness only."""


class Camera:
    """Logs each frame with the driver's stamp; a camera that breaks off is opened again."""

    Config = CameraConfig
    pace: Pace = "paced"
    drivers = (Driver("cv2", "opencv-python-headless", ""),)

    def __init__(self, config: CameraConfig) -> None:
        self.config = config
        self.clock = MonotonicClock()

    @staticmethod
    def probe() -> list[Device]:
        """V4L2 devices of this machine."""
        found = []
        for path in sorted(Path("/dev").glob("video*")):
            name = Path("/sys/class/video4linux") / path.name / "name"
            text = name.read_text().strip() if name.exists() else "video device"
            found.append(Device(str(path), text))
        return found

    def run(self, sink: Sink) -> SourceResult:
        """Log until interrupted; `SourceMissing` if the camera cannot be opened at first."""
        camera = self._open()
        if camera is None:
            devices = ", ".join(device.address for device in self.probe()) or "none"
            raise SourceMissing(
                f"camera {self.config.device!r} cannot be opened; V4L2 devices here: {devices}"
            )
        sink.channel(TOPIC, {"device": str(self.config.device)})
        note = sink.channel("/events").put
        while True:
            self._pump(camera, sink)
            text = f"camera {self.config.device!r}"
            note(self.clock.now_ns(), EVENT_KINDS["FAULT"], f"{text} is lost and is opened again")
            camera.release()
            while (again := self._open()) is None:
                time.sleep(_REOPEN_S)
            camera = again
            note(self.clock.now_ns(), EVENT_KINDS["NOTE"], f"{text} is back")

    def _pump(self, camera: Any, sink: Sink) -> None:
        import cv2

        while camera.grab():
            arrival_ns = self.clock.now_ns()
            stamp_ns = self._stamp_ns(camera.get(cv2.CAP_PROP_POS_MSEC), arrival_ns)
            whole, image = camera.retrieve()
            if not whole:
                return
            if self.config.grey and image.ndim == 3:
                image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
            sink.log_frame(TOPIC, image, stamp_ns)

    def _stamp_ns(self, position_ms: float, arrival_ns: int) -> int:
        """V4L2 tells the exposure's time on the monotonic clock; others tell something else."""
        stamp_ns = round(position_ms * 1e6) + self.clock.anchor_ns
        return stamp_ns if 0 <= arrival_ns - stamp_ns < _FRESH_NS else arrival_ns

    def _open(self) -> Any | None:
        os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
        import cv2

        config = self.config
        is_local = isinstance(config.device, int) or config.device.startswith("/dev/")
        camera = cv2.VideoCapture(config.device, cv2.CAP_V4L2 if is_local else cv2.CAP_ANY)
        if not camera.isOpened():
            return None
        wanted: list[tuple[int, float | None]] = [
            (cv2.CAP_PROP_FRAME_WIDTH, config.width_px),
            (cv2.CAP_PROP_FRAME_HEIGHT, config.height_px),
            (cv2.CAP_PROP_FPS, config.rate_hz),
        ]
        if config.pixel_format:
            wanted.insert(0, (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*config.pixel_format)))
        if config.exposure is not None:
            wanted += [(cv2.CAP_PROP_AUTO_EXPOSURE, 1), (cv2.CAP_PROP_EXPOSURE, config.exposure)]
        for key, value in wanted:
            if value is not None:
                camera.set(key, value)
        return camera
