"""The source `genicam`: industrial cameras through the GenTL producer of their maker."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from seamlog.channels import EVENT_KINDS
from seamlog.clock import MonotonicClock
from seamlog.contracts import Device, Pace, Sink, SourceResult
from seamlog.errors import SourceMissing

from .camera import TOPIC
from .device_clock import DeviceClock
from .drivers import HARVESTERS

_SEARCH_PATH = "GENICAM_GENTL64_PATH"
_FORMATS = {
    "Mono8": 1,
    "RGB8": 3,
    "BGR8": 3,
    "RGBa8": 4,
    "BGRa8": 4,
    "BayerRG8": 1,
    "BayerGB8": 1,
    "BayerGR8": 1,
    "BayerBG8": 1,
}
"""Pixel formats that are taken, and their samples per pixel."""


class GenicamConfig(BaseModel):
    """Which camera, and its features by their GenICam names."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    producer: Path | None = None
    """The .cti file; else those in the folders of GENICAM_GENTL64_PATH."""
    device: str = ""
    """Id or serial number as `seamlog sources probe genicam` tells it; else the first."""
    features: dict[str, bool | int | float | str] = Field(default_factory=dict)
    """Such as PixelFormat = "Mono8", ExposureTime = 5000.0, TriggerMode = "On"."""
    timeout_s: float = Field(5.0, gt=0)


class GenicamCamera:
    """Logs each picture with the camera's stamp, or that of its arrival where it has none."""

    Config = GenicamConfig
    pace: Pace = "paced"
    drivers = (HARVESTERS,)

    def __init__(self, config: GenicamConfig) -> None:
        self.config = config
        self.clock = MonotonicClock()

    @staticmethod
    def probe() -> list[Device]:
        """Cameras that the producers in GENICAM_GENTL64_PATH see."""
        with _harvester(None) as harvester:
            return [
                Device(row.id_, f"{row.vendor} {row.model} {row.serial_number}")
                for row in harvester.device_info_list
            ]

    def run(self, sink: Sink) -> SourceResult:
        """Log until interrupted; `SourceMissing` without producer or camera."""
        with _harvester(self.config.producer) as harvester, self._acquirer(harvester) as acquirer:
            metadata = {"stamp": "arrival"}
            clock: DeviceClock | None = None
            first = acquirer.fetch(timeout=self.config.timeout_s)
            with first:
                if _camera_ns(first) is not None:
                    clock, metadata = DeviceClock(1.0), {"stamp": "camera"}
            sink.channel(TOPIC, metadata)
            self._pump(acquirer, sink, clock)
        raise AssertionError("unreachable: the pump ends by interruption")

    def _pump(self, acquirer: Any, sink: Sink, clock: DeviceClock | None) -> None:
        note, is_silent = sink.channel("/events").put, False
        while True:
            try:
                buffer = acquirer.fetch(timeout=self.config.timeout_s)
            except HARVESTERS.load("core").TimeoutException:
                if not is_silent:
                    text = f"the camera sends nothing for {self.config.timeout_s:g} s"
                    note(self.clock.now_ns(), EVENT_KINDS["FAULT"], text)
                is_silent = True
                continue
            is_silent = False
            arrival_ns = self.clock.now_ns()
            with buffer:
                camera_ns = _camera_ns(buffer) if clock else None
                stamp_ns = clock.stamp_ns(camera_ns, arrival_ns) if clock and camera_ns else None
                component = buffer.payload.components[0]
                sink.log_frame(TOPIC, _image(component), stamp_ns or arrival_ns)

    @contextmanager
    def _acquirer(self, harvester: Any) -> Iterator[Any]:
        rows = list(harvester.device_info_list)
        wanted = self.config.device
        places = [i for i, row in enumerate(rows) if wanted in ("", row.id_, row.serial_number)]
        if not places:
            known = ", ".join(row.id_ for row in rows) or "none"
            raise SourceMissing(f"no camera {wanted!r}; the producer sees: {known}")
        # harvesters takes Ctrl-C for itself, and would end the stream below us.
        interrupt = signal.getsignal(signal.SIGINT)
        acquirer = harvester.create(places[0])
        signal.signal(signal.SIGINT, interrupt)
        try:
            self._set_features(acquirer.remote_device.node_map)
            acquirer.start()
            yield acquirer
        finally:
            acquirer.destroy()

    def _set_features(self, node_map: Any) -> None:
        for name, value in self.config.features.items():
            try:
                getattr(node_map, name).value = value
            except Exception as error:
                # Node maps raise errors of a C++ library that have no common base.
                raise SourceMissing(
                    f"the camera does not take {name} = {value!r}: {error}"
                ) from error


@contextmanager
def _harvester(producer: Path | None) -> Iterator[Any]:
    files = [producer] if producer else _producers()
    if not files:
        raise SourceMissing(
            f"no GenTL producer: install that of the camera's maker, and set {_SEARCH_PATH} or "
            "source.producer to its .cti"
        )
    harvester = HARVESTERS.load("core").Harvester()
    try:
        for file in files:
            if not file.is_file():
                raise SourceMissing(f"{file}: no such GenTL producer")
            harvester.add_file(str(file), check_existence=True)
        harvester.update()
        yield harvester
    finally:
        harvester.reset()


def _producers() -> list[Path]:
    folders = filter(None, os.environ.get(_SEARCH_PATH, "").split(os.pathsep))
    return [file for folder in folders for file in sorted(Path(folder).glob("*.cti"))]


def _camera_ns(buffer: Any) -> int | None:
    """The camera's own time; None where the producer has none."""
    try:
        ticks, frequency_hz = int(buffer.timestamp), int(buffer.timestamp_frequency)
    except Exception:  # noqa: BLE001 - errors of the GenTL producer have no common base
        return None
    return ticks * 10**9 // frequency_hz if ticks and frequency_hz else None


def _image(component: Any) -> NDArray[np.uint8]:
    import cv2

    name = str(component.data_format)
    samples = _FORMATS.get(name)
    if samples is None:
        raise SourceMissing(
            f"pixel format {name} is not taken; set features.PixelFormat to one of "
            f"{', '.join(_FORMATS)}"
        )
    image: NDArray[np.uint8] = component.data.reshape(component.height, component.width, samples)
    if samples == 1:
        bayer = getattr(cv2, f"COLOR_{name[:-1]}2BGR", None) if name.startswith("Bayer") else None
        grey = image[:, :, 0]
        return grey if bayer is None else cv2.cvtColor(grey, bayer).astype(np.uint8, copy=False)
    turned = name.startswith("RGB")
    return np.ascontiguousarray(image[:, :, 2::-1] if turned else image[:, :, :3])
