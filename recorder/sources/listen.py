"""The source `listen`: a loop in another process or language, heard over ZeroMQ."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from seamlog.channels import EVENT_KINDS
from seamlog.clock import MonotonicClock
from seamlog.contracts import Pace, Sink, SourceResult
from seamlog.errors import SourceMissing

from .drivers import ZEROMQ
from .wire import END, parse

DEFAULT = "tcp://127.0.0.1:5577"
_WAITING = 100_000
"""Messages that wait in ZeroMQ at most; then the sender's own queue fills."""
_LARGEST_BYTES = 64 << 20
_LOOK_MS = 200


class ListenConfig(BaseModel):
    """Where to listen, and what is to stand in the channels' metadata."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str = DEFAULT
    """Loopback by default: whoever reaches the address can write into the session."""
    metadata: dict[str, dict[str, str]] = Field(default_factory=dict)
    """Channel metadata by topic, such as the unit of `/table/command`."""


class Listener:
    """Logs what arrives; a message that makes no sense is counted and its fault an event."""

    Config = ListenConfig
    pace: Pace = "paced"
    drivers = (ZEROMQ,)

    def __init__(self, config: ListenConfig) -> None:
        self.config = config
        self.clock = MonotonicClock()

    def run(self, sink: Sink) -> SourceResult:
        """Log until a sender says "end" or the recording is interrupted."""
        zmq = ZEROMQ.load()
        with zmq.Context() as context, context.socket(zmq.PULL) as socket:
            socket.linger, socket.rcvhwm = 0, _WAITING
            socket.maxmsgsize = _LARGEST_BYTES
            try:
                socket.bind(self.config.address)
            except zmq.ZMQError as error:
                raise SourceMissing(
                    f"{self.config.address} cannot be listened to: {error}; give --listen "
                    f"another address such as {DEFAULT}"
                ) from error
            self._hear(sink, socket)
        return SourceResult()

    def _hear(self, sink: Sink, socket: Any) -> None:
        puts: dict[str, Any] = {}
        note = puts["/events"] = self._channel(sink, "/events").put
        faults: dict[str, int] = {}
        try:
            while True:
                if not socket.poll(_LOOK_MS):
                    continue
                parts = socket.recv_multipart()
                if parts == [END]:
                    return
                try:
                    topic, stamp_ns, values = parse(parts)
                except ValueError as error:
                    if str(error) not in faults and len(faults) < 100:
                        note(self.clock.now_ns(), EVENT_KINDS["FAULT"], f"not logged: {error}")
                    faults[str(error)] = faults.get(str(error), 0) + 1
                    continue
                put = puts.get(topic)
                if put is None:
                    put = puts[topic] = self._channel(sink, topic).put
                put(stamp_ns or self.clock.now_ns(), *values)
        finally:
            count = str(sum(faults.values()))
            sink.add_metadata("seamlog.source", {"address": self.config.address, "faults": count})

    def _channel(self, sink: Sink, topic: str) -> Any:
        return sink.channel(topic, self.config.metadata.get(topic))
