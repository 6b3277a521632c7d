"""Pictures of a session, found by time and read one by one."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import IMAGE_SCHEMA
from seamlog.errors import FrameMissing, SessionError
from seamlog.limits import LIMITS, Limits
from seamlog.mcap.chunks import read_chunk
from seamlog.mcap.file import McapFile
from seamlog.mcap.parsing import Cursor
from seamlog.mcap.records import ChannelRecord, ChunkEntry, Malformed
from seamlog.mcap.rows import PAYLOAD
from seamlog.pictures import decode_picture

if TYPE_CHECKING:
    from seamlog.session import Session

_STAMP = struct.Struct("<iI")
_CDR = b"\x00\x01"


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture; `data` are its encoded bytes."""

    stamp_ns: int
    log_time_ns: int
    format: str
    data: bytes
    where: str
    limits: Limits = LIMITS

    def image(self) -> NDArray[Any]:
        """Pixels, uint8, shape (rows, columns) grey or (rows, columns, 3) BGR."""
        return decode_picture(self.data, self.where, self.limits)


@dataclass(frozen=True, slots=True)
class _Place:
    file: McapFile
    channel_id: int
    entry: ChunkEntry
    offset: int
    log_time_ns: int


class Frames(Sequence[Frame]):
    """The pictures of one topic in order of log time; made by `Session.frames`."""

    def __init__(self, session: "Session", topic: str) -> None:
        self.topic = topic
        self._limits = session.limits
        found = session.schema(topic)
        if found != IMAGE_SCHEMA:
            raise SessionError(
                f"{session.path}: {topic} holds {found or 'messages without a schema'}, "
                f"not {IMAGE_SCHEMA}; read it with columns()"
            )
        places = [
            place
            for file in session.files
            for row in file.channels(topic)
            for place in _places(file, row, session.span)
        ]
        self._places = sorted(places, key=lambda place: place.log_time_ns)
        self._chunk: tuple[McapFile, int, memoryview] | None = None

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[place] for place in range(*index.indices(len(self)))]
        return self._read(self._places[index])

    def __iter__(self) -> Iterator[Frame]:
        return (self._read(place) for place in self._places)

    @cached_property
    def log_times_ns(self) -> NDArray[np.int64]:
        """Log time of each frame."""
        return np.array([place.log_time_ns for place in self._places], np.int64)

    @cached_property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Stamp (time of exposure) of each frame, without reading the pictures."""
        return np.array([self._stamp(place) for place in self._places], np.int64)

    @cached_property
    def _by_stamp(self) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
        order = np.argsort(self.stamps_ns, kind="stable")
        return self.stamps_ns[order], order

    def at(self, time_ns: int) -> Frame:
        """The frame whose stamp is nearest to `time_ns`; `FrameMissing` if there is none."""
        if not len(self):
            raise FrameMissing(f"{self.topic} has no frames near {time_ns} ns; the window is empty")
        stamps, order = self._by_stamp
        after = int(np.searchsorted(stamps, time_ns))
        near = [place for place in (after - 1, after) if 0 <= place < len(stamps)]
        best = min(near, key=lambda place: abs(int(stamps[place]) - time_ns))
        return self[int(order[best])]

    def _stamp(self, place: _Place) -> int:
        if place.entry.compression == "":
            place.file.source.used()
            start = place.entry.offset + place.entry.length - place.entry.compressed_size
            data = place.file.source.data[start : start + place.entry.compressed_size]
        else:
            data = self._unpacked(place)
        seconds, rest = _STAMP.unpack_from(data, place.offset + PAYLOAD + 4)
        return int(seconds) * 1_000_000_000 + int(rest)

    def _unpacked(self, place: _Place) -> memoryview:
        held = self._chunk
        if held is not None and held[0] is place.file and held[1] == place.entry.offset:
            return held[2]
        try:
            data = read_chunk(place.file.source, place.entry, self._limits)
        except Malformed as error:
            raise self._missing(place, str(error)) from error
        self._chunk = (place.file, place.entry.offset, data)
        return data

    def _missing(self, place: _Place, reason: str) -> FrameMissing:
        problem = (
            f"{place.file.path}: the frame of {self.topic} at {place.log_time_ns} ns (chunk at "
            f"byte {place.entry.offset}) cannot be read: {reason}"
        )
        place.file.note(problem)
        return FrameMissing(problem)

    def _read(self, place: _Place) -> Frame:
        data = self._unpacked(place)
        try:
            return self._parsed(place, data)
        except (Malformed, struct.error) as error:
            raise self._missing(place, str(error)) from error

    def _parsed(self, place: _Place, data: memoryview) -> Frame:
        opcode, length, channel_id, _, log_time = struct.unpack_from("<BQHIQ", data, place.offset)
        if (opcode, channel_id, log_time) != (5, place.channel_id, place.log_time_ns):
            raise Malformed("its message index is damaged")
        end = place.offset + 9 + length
        payload = data[place.offset + PAYLOAD : end]
        if payload[:2] != _CDR:
            raise Malformed("it is no little-endian CDR")
        body = Cursor(payload[4:])
        seconds, rest = body.unpack(_STAMP)
        _cdr_string(body)
        image_format = _cdr_string(body)
        body.align(4)
        picture = bytes(body.take(body.u32()))
        stamp = seconds * 1_000_000_000 + rest
        where = f"{place.file.path}: {self.topic} at {log_time} ns"
        return Frame(stamp, log_time, image_format, picture, where, self._limits)


def _cdr_string(body: Cursor) -> str:
    body.align(4)
    data = bytes(body.take(body.u32()))
    return data.rstrip(b"\x00").decode(errors="replace")


def _places(file: McapFile, row: ChannelRecord, window: tuple[int, int]) -> Iterator[_Place]:
    for entry in file.entries(row.id, window):
        for time, offset in file.message_places(entry, row.id):
            if window[0] <= time < window[1]:
                yield _Place(file, row.id, entry, offset, time)
