"""One ring per producer and channel in shared memory: single producer, single consumer, no lock.

A ring is a file of a header page and `capacity` bytes of records. All words of the header are
64-bit and aligned, so that each store is whole. Rings of fixed-width messages count `head` and
`tail` in messages: one store publishes a message and counts it, and a loop killed between two
instructions leaves the accounts exact. Other rings count them in bytes.

Layout: the header page holds 64-bit little-endian words, numbered as below: 0-6 of the producer,
16-24 of the consumer, 32-34 that the ring is one, its capacity and its stride; from byte 1024 on
two bytes of length and the text why a message was turned away first. Records follow at byte 4096:
fixed-width messages stand in slots of `stride` bytes, message n in slot n % slots, and `head` and
`tail` count messages; others stand one behind the other as MCAP Message records (or RAW_FRAME,
see `varying.RAW_HEAD`), a SKIP byte says that the rest up to the end is unused, and `head` and
`tail` count bytes. What is between `tail` and `head` is not in the session file yet, but for the
last chunk, which may be in both if the recorder died between writing it and moving `tail`: its
sequence numbers tell.

The producer stores a record and then `head`; the consumer reads `head` and, at least one system
call later, the records, which it verifies. On x86-64 the order of stores is given; elsewhere the
delay and the verification stand in for a barrier.
"""

import mmap
import os
import struct
from dataclasses import dataclass
from pathlib import Path

from seamlog.errors import SpaceMissing

HEADER_BYTES = 4096
MAGIC = int.from_bytes(b"SEAMRING", "little")

(HEAD, ACCEPTED, DROPPED, REFUSED, REFUSED_FOREIGN, FIRST_DROPPED, LAST_DROPPED) = range(7)
"""Words of the producer; the two sequences are stored plus one, 0 means none."""
(TAIL, WRITTEN, LOST, HIGH_WATER_PPM, LAST_SYNC_NS, DISCARDED, DURABLE, TAKEN_IN) = range(16, 24)
"""Words of the consumer, on a cache line of their own; TAKEN_IN is 1 once it watches the ring."""
ENDED = 24
"""Word of the consumer: 1 once the recording ends; what comes later is not written."""
(MAGIC_WORD, CAPACITY, STRIDE) = range(32, 35)
_REASON_AT, _REASON_BYTES = 1024, 1000

RECORD = struct.Struct("<BQHIQQ")
"""Head of an MCAP Message record: opcode, length, channel, sequence, log and publish time."""
MESSAGE = 5
RAW_FRAME = 0x80
"""Opcode of a picture that the recorder process is to encode; it never reaches a file."""
SKIP = 0
"""Opcode of the unused rest of a ring before it begins again."""
RECORD_HEAD_BYTES = 9
"""Opcode and length."""


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A mapped ring; `stride` is 0 for records of varying length."""

    words: memoryview
    data: memoryview
    capacity: int
    stride: int

    @property
    def slots(self) -> int:
        """Messages that a ring of fixed stride holds."""
        return self.capacity // self.stride

    @property
    def accepted(self) -> int:
        """Messages taken in so far, as the producer counts them."""
        return int(self.words[HEAD if self.stride else ACCEPTED])

    @property
    def reason(self) -> str:
        """Why the first refused message was refused; empty if none was."""
        header = self.words.cast("B")
        size = min(header[_REASON_AT] | header[_REASON_AT + 1] << 8, _REASON_BYTES)
        return bytes(header[_REASON_AT + 2 : _REASON_AT + 2 + size]).decode(errors="replace")

    def keep_reason(self, text: str) -> None:
        """Keep why a message was refused, the first time."""
        header = self.words.cast("B")
        data = text.encode(errors="replace")[:_REASON_BYTES]
        if not self.reason and data:
            header[_REASON_AT + 2 : _REASON_AT + 2 + len(data)] = data
            header[_REASON_AT : _REASON_AT + 2] = len(data).to_bytes(2, "little")


def create_ring(path: Path, capacity: int, stride: int) -> Ring:
    """Make a ring with all its memory allocated and mapped; `SpaceMissing` if there is too little.

    A `stride` above 0 rounds `capacity` (bytes) down to whole messages.
    """
    capacity -= capacity % stride if stride else 0
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        _allocate(descriptor, path, HEADER_BYTES + capacity)
        ring = _map(descriptor, capacity, stride)
    finally:
        os.close(descriptor)
    ring.words[CAPACITY], ring.words[STRIDE], ring.words[MAGIC_WORD] = capacity, stride, MAGIC
    return ring


def open_ring(path: Path) -> Ring:
    """Map a ring that another process made; `ValueError` if it is none."""
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        size = os.fstat(descriptor).st_size
        head = struct.unpack("<3Q", os.pread(descriptor, 24, MAGIC_WORD * 8).ljust(24, b"\0"))
        if head[0] != MAGIC or HEADER_BYTES + head[1] != size:
            raise ValueError(f"{path} is not a ring of seamlog")
        return _map(descriptor, head[1], head[2])
    finally:
        os.close(descriptor)


def holds_messages(path: Path) -> bool:
    """True if messages wait in the ring at `path`, which nobody writes any more."""
    with path.open("rb") as file:
        words = struct.unpack("<40Q", file.read(320).ljust(320, b"\0"))
    return bool(words[MAGIC_WORD] == MAGIC and words[HEAD] > words[TAIL])


def _allocate(descriptor: int, path: Path, size: int) -> None:
    try:
        os.posix_fallocate(descriptor, 0, size)
    except OSError as error:
        path.unlink()
        free = os.statvfs(path.parent)
        raise SpaceMissing(
            f"{path.parent}: a ring needs {size / 2**20:.0f} MiB of shared memory and "
            f"{free.f_bavail * free.f_frsize / 2**20:.0f} MiB are free; make /dev/shm larger "
            "(containers: --shm-size) or close other recordings"
        ) from error


def _map(descriptor: int, capacity: int, stride: int) -> Ring:
    flags = mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0)
    mapped = memoryview(mmap.mmap(descriptor, HEADER_BYTES + capacity, flags))
    return Ring(mapped[:HEADER_BYTES].cast("Q"), mapped[HEADER_BYTES:], capacity, stride)
