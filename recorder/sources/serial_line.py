"""The source `serial`: an encoder or another device that sends frames over a serial line."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from seamlog.channels import EVENT_KINDS
from seamlog.clock import MonotonicClock
from seamlog.contracts import Device, Pace, Sink, SourceResult
from seamlog.errors import SourceMissing

from .device_clock import DeviceClock
from .drivers import SERIAL
from .frames import SerialFrame
from .values import FieldValue, NumericTopic, absent_fields, check_fields, field_reader

if TYPE_CHECKING:
    from .frames import FrameReader

_LOOK_S = 0.05
_REOPEN_S = 0.5


class LineConfig(BaseModel):
    """The line itself."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    port: str
    baud: int = Field(115_200, ge=50, le=12_000_000)
    parity: Literal["N", "E", "O", "M", "S"] = "N"
    data_bits: Literal[5, 6, 7, 8] = 8
    stop_bits: Literal[1, 2] = 1

    @property
    def byte_ns(self) -> float:
        """Time that one byte takes on the line."""
        bits = 1 + self.data_bits + (self.parity != "N") + self.stop_bits
        return bits / self.baud * 1e9


class DeviceTime(BaseModel):
    """The value of a frame that is the device's own time: `tick_s` seconds per count."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    tick_s: float = Field(gt=0)
    wraps: int = Field(0, ge=0)
    """Where the counter begins again, such as 65536; 0 if it does not."""


class SerialConfig(LineConfig):
    """What the device sends, and what becomes of it."""

    topic: NumericTopic = "/table/encoder"
    frame: SerialFrame
    values: dict[str, FieldValue] = Field(min_length=1)
    time: DeviceTime | None = None
    request: str = ""
    """Text that is sent once after opening, for devices that must be asked; escapes as in TOML."""

    @model_validator(mode="after")
    def _fields_fit(self) -> "SerialConfig":
        check_fields(self.topic, self.values, self.frame.names)
        if self.time is not None and self.time.name not in self.frame.names:
            raise ValueError(f"a frame holds no {self.time.name}, which time.name asks for")
        return self


class SerialLine:
    """Logs frame by frame; a line that breaks is opened again, and the gap is an event."""

    Config = SerialConfig
    pace: Pace = "paced"
    drivers = (SERIAL,)

    def __init__(self, config: SerialConfig) -> None:
        self.config = config
        self.clock = MonotonicClock()

    @staticmethod
    def probe() -> list[Device]:
        """Serial ports of this machine."""
        ports = SERIAL.load("tools.list_ports").comports()
        return [Device(port.device, port.description) for port in ports]

    def run(self, sink: Sink) -> SourceResult:
        """Log until interrupted; `SourceMissing` if the port cannot be opened at first."""
        config = self.config
        metadata = absent_fields(config.topic, config.values) | {"device": config.port}
        put = sink.channel(config.topic, metadata).put
        note = sink.channel("/events").put
        read = field_reader(config.topic, config.values)
        reader = config.frame.reader()
        line = self._open()
        with _summary(sink, reader):
            while True:
                try:
                    self._pump(line, reader, read, put)
                except (OSError, SERIAL.load().SerialException) as error:
                    kind, now = EVENT_KINDS["FAULT"], self.clock.now_ns()
                    note(now, kind, f"{config.port} is lost and is opened again: {error}")
                    line.close()
                    line = self._reopen()
                    note(self.clock.now_ns(), EVENT_KINDS["NOTE"], f"{config.port} is back")

    def _pump(self, line: Any, reader: "FrameReader", read: Any, put: Any) -> None:
        clock = self._device_clock()
        byte_ns, time_value = self.config.byte_ns, self.config.time
        while True:
            data = line.read(max(1, line.in_waiting))
            now_ns = self.clock.now_ns()
            for values, behind in reader.feed(data):
                stamp_ns = now_ns - round(behind * byte_ns)
                if clock is not None and time_value is not None:
                    stamp_ns = clock.stamp_ns(int(values[time_value.name]), now_ns)
                put(stamp_ns, *read(values))

    def _device_clock(self) -> DeviceClock | None:
        time_value = self.config.time
        if time_value is None:
            return None
        return DeviceClock(time_value.tick_s * 1e9, time_value.wraps)

    def _open(self) -> Any:
        try:
            return open_line(self.config, self.config.request)
        except (OSError, ValueError) as error:
            found = ", ".join(device.address for device in self.probe()) or "none"
            raise SourceMissing(
                f"{self.config.port} cannot be opened: {error}; serial ports here: {found}"
            ) from error

    def _reopen(self) -> Any:
        while True:
            try:
                return open_line(self.config, self.config.request)
            except (OSError, ValueError):
                time.sleep(_REOPEN_S)


def open_line(config: LineConfig, request: str = "") -> Any:
    """The open port; `OSError` if it is not there."""
    line = SERIAL.load().Serial(
        config.port,
        config.baud,
        config.data_bits,
        config.parity,
        config.stop_bits,
        timeout=_LOOK_S,
        exclusive=True,
    )
    if request:
        line.write(request.encode())
    return line


@contextmanager
def _summary(sink: Sink, reader: "FrameReader") -> Iterator[None]:
    """Whatever ends the recording, the session says how many frames were damaged."""
    try:
        yield
    finally:
        values = {"damaged_frames": str(reader.bad)}
        sink.add_metadata(
            "seamlog.source", values | ({"first": reader.example} if reader.bad else {})
        )
