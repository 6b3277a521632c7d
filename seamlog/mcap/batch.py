"""Writes whole sessions at once: columns go in as numpy arrays, a finished file comes out."""

import uuid
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from seamlog import __version__
from seamlog.channels import CHANNELS, IMAGE_SCHEMA, Channel
from seamlog.errors import UnknownName, UsageError
from seamlog.files import replacing
from seamlog.mcap.compacting import compact_files
from seamlog.mcap.compression import COMPRESSIONS, NONE
from seamlog.mcap.copying import copy_attachments, copy_file
from seamlog.mcap.file import McapFile
from seamlog.mcap.packing import RecordTemplate, payload_records
from seamlog.mcap.records import Schema
from seamlog.mcap.streams import MessageStream
from seamlog.mcap.writer import FileWriter
from seamlog.messages import definition
from seamlog.segments import PROBLEMS, RECORDING

if TYPE_CHECKING:
    from seamlog.session import Session

_CHUNK_BYTES = 2 << 20


class BatchWriter:
    """Writes a session to `path`, whole or not at all; use it as a context manager.

    Chunks of 2 MiB, one channel each; pictures are stored uncompressed. `OutputExists` if
    the file is there and `force` is not set.
    """

    def __init__(self, path: Path | str, force: bool = False, compression: str = "zstd") -> None:
        if compression not in COMPRESSIONS:
            raise UsageError(f"compression {compression!r} is none of zstd, lz4 and '' (none)")
        self.path, self._force, self._compression = Path(path), force, compression
        self._stack = ExitStack()
        self._channels: dict[tuple[Any, ...], int] = {}
        self._sequences: dict[int, int] = {}
        self._metadata: set[str] = set()
        self._streams: list[MessageStream] = []

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            partial = stack.enter_context(replacing(self.path, self._force))
            file = stack.enter_context(partial.open("xb", buffering=0))
            self._writer = FileWriter(file, f"seamlog {__version__}")
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            self._stack.__exit__(kind, error, trace)
            return
        with self._stack:
            for stream in self._streams:
                stream.flush()
            if RECORDING not in self._metadata:
                self.add_metadata(RECORDING, {"id": uuid.uuid4().hex, "index": "1"})
            self._writer.finish()

    def write(
        self,
        topic: str,
        columns: Mapping[str, Any],
        log_times_ns: NDArray[np.int64] | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Write messages of a fixed-width topic of the table; see `write_as`."""
        if topic not in CHANNELS:
            raise UnknownName(f"{topic} is not in the channel table; use write_as")
        self.write_as(topic, CHANNELS[topic], columns, log_times_ns, metadata)

    def write_as(
        self,
        topic: str,
        channel: Channel,
        columns: Mapping[str, Any],
        log_times_ns: NDArray[np.int64] | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Write messages of `channel`'s form under another topic.

        One array per field, all of one length n (shape (n, k) for arrays of k), floats where the
        field is one. Log times (ns) are the stamps unless given. Raises `UsageError`.
        """
        number = self.channel(topic, channel, metadata)
        template = RecordTemplate(channel, number)
        ready = template.checked(topic, columns)
        times = _log_times(topic, log_times_ns, ready["stamp_ns"])
        rows = -(-_CHUNK_BYTES // template.stride)
        first = self._sequence(number, len(times))
        for start in range(0, len(times), rows):
            part = slice(start, start + rows)
            data, offsets = template.pack(ready, times, part, first)
            chunk_times = times[part].view(np.uint64)
            self._writer.write_chunk(
                number, data, chunk_times, offsets, self._compression, standalone=False
            )

    def write_payloads(
        self,
        topic: str,
        channel: Channel,
        payloads: Sequence[bytes],
        log_times_ns: Sequence[int] | NDArray[np.int64],
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Write messages that are CDR payloads already (see `seamlog.messages`)."""
        number = self.channel(topic, channel, metadata)
        times = _log_times(topic, np.asarray(log_times_ns, np.int64), None)
        if len(times) != len(payloads):
            raise UsageError(f"{topic}: {len(payloads)} payloads but {len(times)} log times")
        compression = NONE if channel.schema == IMAGE_SCHEMA else self._compression
        first = self._sequence(number, len(times))
        for part in _parts(payloads):
            data, offsets = payload_records(payloads, times, part, number, first)
            chunk_times = times[part].view(np.uint64)
            self._writer.write_chunk(
                number, data, chunk_times, offsets, compression, standalone=False
            )

    def stream(
        self,
        topic: str,
        schema: Schema | None,
        message_encoding: str = "cdr",
        metadata: Mapping[str, str] | None = None,
    ) -> MessageStream:
        """A channel of any messages, which come one by one; they are written as they are."""
        number = 0
        if schema is not None:
            number = self._writer.schema_id(schema.name, schema.data, schema.encoding)
        channel = self._writer.add_channel(topic, number, metadata or {}, message_encoding)
        name = schema.name if schema else ""
        self._streams.append(MessageStream(self._writer, channel, name, self._compression))
        return self._streams[-1]

    def channel(
        self, topic: str, channel: Channel, metadata: Mapping[str, str] | None = None
    ) -> int:
        """The id of a channel, made at its first use; it may stay without messages."""
        values = dict(metadata or {})
        key = (topic, channel.schema, tuple(sorted(values.items())))
        if key not in self._channels:
            schema = self._writer.schema_id(channel.schema, definition(channel))
            self._channels[key] = self._writer.add_channel(topic, schema, values)
        return self._channels[key]

    def _sequence(self, number: int, count: int) -> int:
        first = self._sequences.get(number, 0)
        self._sequences[number] = first + count
        return first

    def attach(
        self,
        name: str,
        data: bytes,
        media_type: str,
        log_time_ns: int = 0,
        create_time_ns: int = 0,
    ) -> None:
        """Put a file into the session."""
        self._writer.add_attachment(name, data, media_type, log_time_ns, create_time_ns)

    def add_metadata(self, name: str, mapping: Mapping[str, str]) -> None:
        """Put a metadata record into the session."""
        self._metadata.add(name)
        self._writer.add_metadata(name, mapping)

    def copy_file(self, file: McapFile) -> None:
        """Copy channels, chunks and attachments of one file; its metadata stays behind."""
        copy_file(file, self._writer)

    def copy_session(
        self, session: "Session", leave_out: Collection[str] = (), same_recording: bool = False
    ) -> None:
        """Copy all channels chunk by chunk, each proved by its CRC, and attachments and metadata.

        Nothing is encoded anew; what is damaged is left out and the copy says so. `leave_out`
        names attachments; the recording's id is copied only if this file takes the place of the
        copied one (`same_recording`). `UsageError` for a window.
        """
        if session.is_window:
            raise UsageError("only a whole session can be copied; write the window's columns")
        for file in session.files:
            copy_file(file, self._writer, leave_out)
        self._copy_metadata(session, same_recording)

    def compact_session(self, session: "Session") -> None:
        """Copy a whole session into large chunks of one channel each; see `copy_session`.

        A session in several files becomes one.
        """
        if session.is_window:
            raise UsageError("only a whole session can be compacted")
        compact_files(session.files, self._writer, self._compression)
        for file in session.files:
            copy_attachments(file, self._writer)
        self._copy_metadata(session, False)

    def _copy_metadata(self, session: "Session", same_recording: bool) -> None:
        lost = list(session.metadata.get(PROBLEMS, {}).values())
        for file in session.files:
            for name, values in file.metadata:
                if name != PROBLEMS and (name != RECORDING or same_recording):
                    self.add_metadata(name, values)
            lost += file.problems
        if lost:
            self.add_metadata(PROBLEMS, {f"{place:03}": text for place, text in enumerate(lost)})


def _log_times(
    topic: str, given: NDArray[np.int64] | None, stamps: NDArray[np.int64] | None
) -> NDArray[np.int64]:
    times = stamps if given is None else np.ascontiguousarray(given)
    assert times is not None
    if times.dtype.kind not in "iu" or times.ndim != 1:
        raise UsageError(f"{topic}: log times must be whole nanoseconds, one per message")
    if stamps is not None and len(times) != len(stamps):
        raise UsageError(f"{topic}: {len(stamps)} messages but {len(times)} log times")
    if len(times) and int(times.min()) < 0:
        raise UsageError(f"{topic}: log time {int(times.min())} ns is before 1970")
    return times.astype(np.int64)


def _parts(payloads: Sequence[bytes]) -> Iterator[slice]:
    start = size = 0
    for place, payload in enumerate(payloads):
        if size and size + len(payload) > _CHUNK_BYTES:
            yield slice(start, place)
            start, size = place, 0
        size += len(payload)
    if start < len(payloads):
        yield slice(start, len(payloads))
