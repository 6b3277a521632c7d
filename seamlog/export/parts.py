"""A topic in parts of bounded size, and what its columns are called and measured in."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from seamlog.channels import CHANNELS, IMAGE_SCHEMA
from seamlog.mcap.columns import LOG_TIME, Columns
from seamlog.mcap.decoders import TYPED
from seamlog.session import Session

_PART_BYTES = 64 << 20


def iter_parts(session: Session, topic: str) -> Iterator[Columns]:
    """Columns of a topic in order of time, at most about 64 MiB of messages at once.

    Parts without messages are left out, yet there is one. Messages without a definition come at
    once: in parts they might have other columns.
    """
    files = [(file, row) for file in session.files for row in file.channels(topic)]
    if any(row.message_encoding not in TYPED for _, row in files):
        yield session.columns(topic)
        return
    sizes = sorted(
        (entry.start_ns, entry.uncompressed_size)
        for file, row in files
        for entry in file.entries(row.id, session.span)
    )
    (start, end), held, is_empty = session.span, 0, True
    for begins, size in sizes:
        if held + size > _PART_BYTES and begins > start:
            columns = session.window(start, begins).columns(topic)
            if len(columns[LOG_TIME]):
                yield columns
                is_empty = False
            start, held = begins, 0
        held += size
    columns = session.window(start, end).columns(topic)
    if is_empty or len(columns[LOG_TIME]):
        yield columns


def exported_topics(session: Session, wanted: tuple[str, ...], pictures: bool) -> list[str]:
    """The topics asked for, else all that have messages in the window.

    Without `pictures`, topics of pictures must be asked for by name.
    """
    for topic in wanted:
        session.check_topic(topic)
    return list(wanted) or [
        row.topic
        for row in session.info.channels.values()
        if row.count and (pictures or row.schema != IMAGE_SCHEMA)
    ]


def units_of(session: Session, topic: str) -> dict[str, str]:
    """Unit of each field, as far as they are known."""
    metadata = session.channel_metadata(topic)
    units = {LOG_TIME: "ns", "stamp_ns": "ns"}
    if topic in CHANNELS:
        for field in CHANNELS[topic].fields:
            unit = metadata.get("unit", "") if field.unit == "metadata" else field.unit
            if unit:
                units[field.name] = unit
    try:
        stated = json.loads(metadata.get("units", "{}"))
    except ValueError:
        stated = {}
    return units | (stated if isinstance(stated, dict) else {})


def file_name(topic: str) -> str:
    """`/table/encoder` as part of a file's name: `table.encoder`."""
    import re

    return re.sub(r"[^\w.-]+", ".", topic).strip(".") or "topic"


def as_text(value: Any) -> str:
    """A text as it is, bytes in hex, nothing as nothing, anything else as JSON."""
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, bytes):
        return value.hex()
    return json.dumps(value, default=_plain, ensure_ascii=False)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
