"""The wire format of `--listen`: what a loop in another language sends for one message.

A message has two or three parts. The first is the topic. Numbers follow little endian: int64
`stamp_ns` (0: now), then each field of the topic in the table's order as float64. Topics with text
or pictures have a third part: the text of `/events` in UTF-8, the bytes of a JPEG or PNG. With
"json " before the topic the second part is instead a JSON object of fields, `stamp_ns` among them
or not. A single part "end" ends the recording.
"""

import json
import struct
from collections.abc import Sequence
from typing import Any, TypeAlias

from seamlog.channels import CHANNELS, IMAGE_SCHEMA, Channel
from seamlog.messages import split_array

END = b"end"
_JSON = "json "
_STAMP = struct.Struct("<q")
_FORMATS = {b"\xff\xd8\xff": "jpeg", b"\x89PNG": "png"}
Message: TypeAlias = tuple[str, int, tuple[Any, ...]]
"""Topic, stamp (0: now), values in the table's order."""


def parse(parts: Sequence[bytes]) -> Message:
    """Read one message; `ValueError` says what is wrong with it."""
    if len(parts) < 2:
        raise ValueError(f"{len(parts)} part; a message has a topic and its values")
    name = bytes(parts[0]).decode("utf-8", "replace")
    topic = name.removeprefix(_JSON)
    row = CHANNELS.get(topic)
    if row is None or topic == "/seamlog/recorder":
        raise ValueError(f"no topic {topic!r}")
    try:
        return _parsed(row, name.startswith(_JSON), parts[1:])
    except (OverflowError, RecursionError) as error:
        raise ValueError(f"{topic}: {error}") from error


def _parsed(row: Channel, is_json: bool, parts: Sequence[bytes]) -> Message:
    if is_json:
        return _from_json(row, parts[0])
    size = len(parts[0])
    if size < _STAMP.size or size % 8:
        raise ValueError(f"{row.topic}: {size} bytes of numbers; 8 for each, the stamp first")
    (stamp_ns,) = _STAMP.unpack_from(parts[0])
    numbers = struct.unpack_from(f"<{size // 8 - 1}d", parts[0], _STAMP.size)
    return row.topic, stamp_ns, _values(row, numbers, parts[1:])


def _from_json(row: Channel, data: bytes) -> Message:
    document = json.loads(data)
    if not isinstance(document, dict):
        raise ValueError(f"{row.topic}: a JSON object of fields is wanted")
    stamp_ns = document.pop("stamp_ns", 0)
    names = row.field_names[1:]
    if set(document) != set(names):
        raise ValueError(
            f"{row.topic} has the fields {', '.join(names)}; got {', '.join(document)}"
        )
    return row.topic, stamp_ns, tuple(document[name] for name in names)


def _values(row: Channel, numbers: Sequence[float], rest: Sequence[bytes]) -> tuple[Any, ...]:
    if row.schema == IMAGE_SCHEMA:
        if len(rest) != 1:
            raise ValueError(f"{row.topic}: a picture is wanted as the third part")
        kind = next((kind for lead, kind in _FORMATS.items() if rest[0].startswith(lead)), None)
        if kind is None:
            raise ValueError(f"{row.topic}: the picture is neither JPEG nor PNG")
        return ("camera", kind, rest[0])
    values: list[Any] = []
    given, texts = list(numbers), list(rest)
    for field in row.fields[1:]:
        base, count = split_array(field.type)
        if base == "string":
            values.append(texts.pop(0).decode("utf-8", "replace") if texts else "")
        elif count == -1:
            raise ValueError(f"{row.topic}: {field.name} varies in length; send it as JSON")
        elif len(given) < (count or 1):
            raise ValueError(f"{row.topic} wants {', '.join(row.field_names[1:])}")
        elif count:
            values.append(given[:count])
            del given[:count]
        else:
            number = given.pop(0)
            values.append(number if base.startswith("float") else int(number))
    if given or texts:
        raise ValueError(f"{row.topic} wants {', '.join(row.field_names[1:])}; got more")
    return tuple(values)
