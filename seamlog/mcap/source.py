"""One MCAP file opened for reading: mapped into memory, so that opening reads nothing."""

import mmap
from contextlib import suppress
from pathlib import Path

from seamlog.errors import SessionError
from seamlog.mcap.records import MAGIC, RECORD_HEAD, Malformed

_AROUND = 64 << 10
"""What the kernel maps around a byte that is read."""
_HELD = 48 << 20
_PAGE = 512
"""What a disk loses at once, and fills with zeros."""


class FileSource:
    """The bytes of a file; raises `SessionError` if it cannot be MCAP."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with path.open("rb") as file:
            self.size = file.seek(0, 2)
            if not self.size:
                raise SessionError(
                    f"{path} is empty: nothing was recorded into it, or the copy failed; "
                    "fetch it again"
                )
            self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        self._data: memoryview | None = memoryview(self._map)
        self._in_memory = 0
        if not _may_be_mcap(self.data):
            self.close()
            raise SessionError(
                f"{path} is no MCAP file (byte 0 does not begin with its magic); "
                "'seamlog import' reads other formats"
            )

    @property
    def data(self) -> memoryview:
        """All bytes; `SessionError` once the file is closed."""
        if self._data is None:
            raise SessionError(f"{self.path} is closed; read it before, inside its with block")
        return self._data

    def used(self, size: int = _AROUND) -> None:
        """Say that `size` more bytes were read; now and then their pages are given back.

        So a reader's memory does not grow with the file; what is still needed comes again.
        """
        self._in_memory += size
        if self._in_memory > _HELD and hasattr(self._map, "madvise"):
            self._map.madvise(mmap.MADV_DONTNEED)
            self._in_memory = 0

    def content(self, offset: int, length: int, opcode: int) -> memoryview:
        """Content of the record of `length` bytes at `offset`; `Malformed` if it is another."""
        if offset < len(MAGIC) or length < RECORD_HEAD.size or offset + length > self.size:
            raise Malformed(f"a record of {length} bytes is not inside the file")
        found = RECORD_HEAD.unpack_from(self.data, offset)
        if found != (opcode, length - RECORD_HEAD.size):
            raise Malformed(f"no record of kind {opcode} and {length} bytes is there")
        return self.data[offset + RECORD_HEAD.size : offset + length]

    def close(self) -> None:
        """Unmap the file; views that are still held keep it until they go."""
        data, self._data = self._data, None
        if data is not None:
            with suppress(BufferError):
                data.release()
                self._map.close()


def _may_be_mcap(data: memoryview) -> bool:
    """True also where a damaged start does not hide that the rest is MCAP."""
    start = bytes(data[: len(MAGIC)])
    if start == MAGIC or data[-len(MAGIC) :] == MAGIC:
        return True
    alike = sum(one == other for one, other in zip(start, MAGIC, strict=False))
    return alike >= len(MAGIC) // 2 or (len(data) > _PAGE and not any(data[:_PAGE]))
