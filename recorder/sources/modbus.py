"""The source `modbus`: registers of a drive or an encoder, read again and again by Modbus RTU."""

import struct
import time
from typing import Any, Literal

from pydantic import Field, model_validator

from seamlog.channels import EVENT_KINDS
from seamlog.clock import MonotonicClock
from seamlog.contracts import Device, Pace, Sink, SourceResult
from seamlog.errors import SourceMissing

from .drivers import MODBUS, SERIAL
from .serial_line import LineConfig, SerialLine
from .values import FieldValue, NumericTopic, absent_fields, check_fields, field_reader

_RETRY_S = 0.5
_MOST_REGISTERS = 125


class ModbusConfig(LineConfig):
    """Which registers, how often, and what becomes of them.

    `layout` (Python's struct, big-endian as Modbus is) says what the registers hold;
    `word_order` "little" puts the low word of a longer value first.
    """

    device_id: int = Field(1, ge=1, le=247)
    period_s: float = Field(0.02, gt=0, le=3600)
    registers: Literal["holding", "input"] = "holding"
    address: int = Field(ge=0, le=65_535)
    layout: str
    names: tuple[str, ...] = Field(min_length=1)
    word_order: Literal["big", "little"] = "big"
    timeout_s: float = Field(0.2, gt=0, le=10)
    topic: NumericTopic = "/table/encoder"
    values: dict[str, FieldValue] = Field(min_length=1)

    @model_validator(mode="after")
    def _fields_fit(self) -> "ModbusConfig":
        check_fields(self.topic, self.values, self.names)
        try:
            values = struct.unpack(self.form, bytes(struct.calcsize(self.form)))
        except struct.error as error:
            raise ValueError(f"layout {self.layout!r}: {error}") from error
        if len(values) != len(self.names):
            raise ValueError(
                f"layout {self.layout!r} has {len(values)} values, names {len(self.names)}"
            )
        if not 0 < self.count <= _MOST_REGISTERS:
            raise ValueError(f"{self.count} registers; one request reads up to {_MOST_REGISTERS}")
        return self

    @property
    def form(self) -> str:
        """`layout`, big-endian unless it says otherwise."""
        return self.layout if self.layout[:1] in "<>!=@" else ">" + self.layout

    @property
    def count(self) -> int:
        """Registers that the layout covers."""
        return -(-struct.calcsize(self.form) // 2)


class ModbusRegisters:
    """Polls at a fixed period; a device that does not answer is asked again, the gap an event."""

    Config = ModbusConfig
    pace: Pace = "paced"
    drivers = (MODBUS, SERIAL)

    def __init__(self, config: ModbusConfig) -> None:
        self.config = config
        self.clock = MonotonicClock()

    @staticmethod
    def probe() -> list[Device]:
        """Serial ports of this machine."""
        return SerialLine.probe()

    def run(self, sink: Sink) -> SourceResult:
        """Poll until interrupted; `SourceMissing` if the device does not answer at first."""
        config = self.config
        client = self._connect()
        metadata = absent_fields(config.topic, config.values) | {"device": config.port}
        put = sink.channel(config.topic, metadata).put
        note = sink.channel("/events").put
        read = field_reader(config.topic, config.values)
        due_s, is_silent = time.monotonic(), False
        while True:
            stamp_ns, values, fault = self._ask(client)
            if values is not None:
                put(stamp_ns, *read(values))
            if (values is None) != is_silent:
                is_silent = values is None
                kind = EVENT_KINDS["FAULT" if is_silent else "NOTE"]
                text = f"no answer: {fault}" if is_silent else "answers again"
                note(self.clock.now_ns(), kind, f"{config.port}, device {config.device_id} {text}")
            due_s = max(due_s + config.period_s, time.monotonic() - config.period_s)
            time.sleep(max(0.0, due_s - time.monotonic()))

    def _connect(self) -> Any:
        config = self.config
        client = MODBUS.load("client").ModbusSerialClient(
            config.port,
            baudrate=config.baud,
            bytesize=config.data_bits,
            parity=config.parity,
            stopbits=config.stop_bits,
            timeout=config.timeout_s,
            retries=0,
        )
        SERIAL.load()
        if not client.connect():
            found = ", ".join(device.address for device in self.probe()) or "none"
            raise SourceMissing(f"{config.port} cannot be opened; serial ports here: {found}")
        fault = ""
        for _ in range(3):
            _, values, fault = self._ask(client)
            if values is not None:
                return client
            time.sleep(_RETRY_S)
        client.close()
        raise SourceMissing(
            f"{config.port}: device {config.device_id} does not answer for {config.count} "
            f"{config.registers} registers from {config.address} on: {fault}"
        )

    def _ask(self, client: Any) -> tuple[int, dict[str, float] | None, str]:
        """Log time half-way between question and answer, the values, or why there are none."""
        config = self.config
        ask = getattr(client, f"read_{config.registers}_registers")
        before_ns = self.clock.now_ns()
        try:
            answer = ask(config.address, count=config.count, device_id=config.device_id)
        except (OSError, MODBUS.load("exceptions").ModbusException) as error:
            return before_ns, None, str(error)
        stamp_ns = (before_ns + self.clock.now_ns()) // 2
        if answer.isError() or len(answer.registers) != config.count:
            return stamp_ns, None, str(answer)
        return stamp_ns, self._values(answer.registers), ""

    def _values(self, registers: list[int]) -> dict[str, float]:
        words = registers[::-1] if self.config.word_order == "little" else registers
        data = struct.pack(f">{len(words)}H", *words)[: struct.calcsize(self.config.form)]
        found = struct.unpack(self.config.form, data)
        names = self.config.names
        return dict(zip(names[::-1] if words is not registers else names, found, strict=True))
