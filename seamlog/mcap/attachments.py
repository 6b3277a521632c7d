"""Attachments (photos, procedures, calibrations) and metadata records, read when asked for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from zlib_ng.zlib_ng import crc32

from seamlog.errors import LimitExceeded, SessionError, UnknownName
from seamlog.limits import Limits
from seamlog.mcap import parsing, records
from seamlog.mcap.records import AttachmentEntry, Malformed
from seamlog.mcap.source import FileSource


@dataclass(frozen=True, slots=True)
class Attachment:
    """A file inside a session."""

    name: str
    media_type: str
    log_time_ns: int
    data: bytes
    create_time_ns: int = 0


def read_attachment(source: FileSource, entry: AttachmentEntry, limits: Limits) -> Attachment:
    """Read one attachment and check its CRC."""
    if entry.length > limits.attachment_bytes:
        raise LimitExceeded(
            f"{source.path}: attachment {entry.name!r} at byte {entry.offset} has {entry.length} "
            f"bytes, more than the limit attachment_bytes = {limits.attachment_bytes}"
        )
    try:
        return _parsed(source.content(entry.offset, entry.length, records.ATTACHMENT))
    except Malformed as error:
        raise SessionError(
            f"{source.path}: attachment {entry.name!r} at byte {entry.offset} is damaged "
            f"({error}); attach the file again"
        ) from error


def _parsed(content: memoryview) -> Attachment:
    cursor = parsing.Cursor(content)
    log_time, create_time = cursor.u64(), cursor.u64()
    name, media_type = cursor.string(), cursor.string()
    data = cursor.take(cursor.u64())
    end = cursor.at
    stored = cursor.u32()
    if stored and crc32(content[:end]) != stored:
        raise Malformed("its CRC is wrong")
    return Attachment(name, media_type, log_time, bytes(data), create_time)


class Attachments(Mapping[str, Attachment]):
    """All attachments by name; of two with one name the later one counts."""

    def __init__(
        self, files: Sequence[tuple[FileSource, Sequence[AttachmentEntry]]], limits: Limits
    ) -> None:
        self._limits = limits
        self._entries = {entry.name: (source, entry) for source, rows in files for entry in rows}

    def __getitem__(self, name: str) -> Attachment:
        if name not in self._entries:
            known = ", ".join(self._entries) or "none"
            raise UnknownName(f"no attachment {name!r}; there are: {known}")
        return read_attachment(*self._entries[name], self._limits)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def entry(self, name: str) -> AttachmentEntry:
        """Size, media type and times of an attachment, without reading it."""
        return self._entries[name][1]
