"""Reading sessions back through the `mcap` package, CRCs checked: the oracle of these tests."""

import struct
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader

from seamlog.channels import CHANNELS
from seamlog.messages import is_fixed, layout


class Read(NamedTuple):
    """One message; `values` behind the stamp, for fixed-width topics."""

    sequence: int
    log_time_ns: int
    publish_time_ns: int
    data: bytes
    values: tuple[float, ...]


def read_session(path: Path) -> dict[str, list[Read]]:
    """Messages by topic, in the order of the file's log times."""
    found: dict[str, list[Read]] = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            values: tuple[float, ...] = ()
            if is_fixed(CHANNELS[channel.topic]):
                codes = struct.Struct("<4x" + layout(channel.topic).codes)
                values = codes.unpack(message.data)[1:]
            times = (message.sequence, message.log_time, message.publish_time)
            found[channel.topic].append(Read(*times, message.data, values))
    return dict(found)


def read_metadata(path: Path) -> dict[str, Mapping[str, str]]:
    """Metadata records by name."""
    with path.open("rb") as file:
        return {row.name: row.metadata for row in make_reader(file).iter_metadata()}


def read_attachments(path: Path) -> dict[str, tuple[str, bytes]]:
    """Attachments by name: media type and data."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return {row.name: (row.media_type, row.data) for row in reader.iter_attachments()}


class StatusRow(NamedTuple):
    """The counts of one `/seamlog/recorder` message."""

    topic: str
    offered: int
    accepted: int
    dropped: int
    refused: int
    written: int
    lost: int


def final_accounts(path: Path) -> dict[str, StatusRow]:
    """The last accounts in the file, by topic."""
    rows = [parse_status(message.data) for message in read_session(path)["/seamlog/recorder"]]
    return {row.topic: row for row in rows}


def parse_status(data: bytes) -> StatusRow:
    """Decode the counts of a RecorderStatus payload."""
    (size,) = struct.unpack_from("<I", data, 12)
    topic = data[16 : 16 + size - 1].decode()
    at = 4 + -(-(12 + size) // 8) * 8
    return StatusRow(topic, *struct.unpack_from("<6Q", data, at))


def assert_all_there(session: Path, accepted: Mapping[str, int]) -> None:
    """All that was accepted is in the session once, in order, and its accounts say so.

    Of each topic one more may have been accepted whose count was not noted any more.
    """
    messages, accounts = read_session(session), final_accounts(session)
    for topic, count in accepted.items():
        found = messages.get(topic, [])
        numbers = [message.sequence for message in found]
        assert numbers in (list(range(count)), list(range(count + 1))), topic
        stamps = [message.publish_time_ns for message in found]
        assert stamps == sorted(set(stamps))
        row = accounts[topic]
        assert row.offered == row.accepted + row.dropped + row.refused
        assert row.accepted == row.written + row.lost == len(found)
        assert (row.lost, row.dropped, row.refused) == (0, 0, 0)
        steps = [message.values[0] for message in found if message.values]
        assert steps in ([], numbers)
    assert read_attachments(session)["wps/a.txt"] == ("text/plain", b"procedure")
