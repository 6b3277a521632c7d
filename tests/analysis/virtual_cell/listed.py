"""A sink that keeps everything in a list, with the log time of each message."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.virtual_cell.source import VirtualCell, VirtualCellConfig
from seamlog.contracts import SourceResult


@dataclass(frozen=True)
class Logged:
    topic: str
    log_time_ns: int
    stamp_ns: int
    values: tuple[Any, ...]


class ListSink:
    def __init__(self, source: VirtualCell) -> None:
        self._clock = source.clock
        self.messages: list[Logged] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.channel_metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}

    def channel(self, topic: str, metadata: Mapping[str, str] | None = None) -> "ListChannel":
        self.channel_metadata[topic] = dict(metadata or {})
        return ListChannel(self, topic)

    def log_frame(self, topic: str, image: NDArray[Any], stamp_ns: int | None = None) -> bool:
        assert stamp_ns is not None
        return self.take(topic, stamp_ns, (image,))

    def take(self, topic: str, stamp_ns: int, values: tuple[Any, ...]) -> bool:
        self.messages.append(Logged(topic, self._clock.now_ns(), stamp_ns, values))
        return True

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        self.attachments[name] = data

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        self.metadata[name] = dict(values)


@dataclass(frozen=True)
class ListChannel:
    sink: ListSink
    topic: str

    def put(self, stamp_ns: int, *values: Any) -> bool:
        return self.sink.take(self.topic, stamp_ns, values)


@dataclass(frozen=True)
class CellRun:
    sink: ListSink
    result: SourceResult
    truth: dict[str, Any] = field(default_factory=dict)

    def of(self, topic: str) -> list[Logged]:
        return [message for message in self.sink.messages if message.topic == topic]

    def column(self, topic: str, index: int) -> np.ndarray:
        return np.array([message.values[index] for message in self.of(topic)])

    def stamps(self, topic: str) -> np.ndarray:
        return np.array([message.stamp_ns for message in self.of(topic)])

    def profile(self, name: str) -> np.ndarray:
        return np.array(self.truth["profile"][name])

    def digest(self) -> str:
        total = hashlib.sha256()
        for message in self.sink.messages:
            total.update(f"{message.topic} {message.log_time_ns} {message.stamp_ns}".encode())
            for value in message.values:
                is_array = isinstance(value, np.ndarray)
                total.update(value.tobytes() if is_array else repr(value).encode())
        for name, data in sorted(self.result.files.items()):
            total.update(name.encode() + data)
        total.update(json.dumps(self.sink.metadata, sort_keys=True).encode())
        return total.hexdigest()


def run_cell(**values: Any) -> CellRun:
    """A short run: 10 s of identification, welding at 12 mm/s unless told otherwise."""
    defaults: dict[str, Any] = {"identification_s": 10.0, "speed_mm_s": 12.0}
    source = VirtualCell(VirtualCellConfig.model_validate(defaults | values))
    sink = ListSink(source)
    result = source.run(sink)
    return CellRun(sink, result, json.loads(sink.metadata["seamlog.truth"]["json"]))
