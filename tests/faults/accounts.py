"""What every test of the programme checks: the accounts against the messages themselves."""

import json
import struct
from collections.abc import Iterator
from pathlib import Path

from seamlog import open_session
from seamlog.recorder import Status
from tests.recorder.sessions import read_session

HEADER, TAIL_WORD, STRIDE_WORD, CAPACITY_WORD = 4096, 16, 34, 33


def check_identities(status: Status) -> None:
    """offered = accepted + dropped + refused; accepted = written + lost + what waits in a ring."""
    for row in status.channels:
        assert row.offered == row.accepted + row.dropped + row.refused
        assert row.accepted == row.written + row.lost + row.discarded + row.waiting
        assert row.waiting >= 0


def session_stamps(path: Path) -> dict[str, list[int]]:
    """Stamps by topic of a finished session, each file read by the `mcap` package, CRCs checked."""
    found: dict[str, list[int]] = {}
    with open_session(path) as session:
        files = session.paths
    for file in files:
        for topic, messages in read_session(file).items():
            found.setdefault(topic, []).extend(m.publish_time_ns for m in messages)
    return found


def unfinished_stamps(path: Path, topic: str) -> list[int]:
    """Stamps in a session that may be cut anywhere."""
    with open_session(path) as session:
        if topic not in session.info.channels:
            return []
        return [int(stamp) for stamp in session.columns(topic)["stamp_ns"]]


def ring_stamps(folder: Path) -> dict[str, list[int]]:
    """Stamps of fixed-width messages that wait in rings, read as recorder/ring.py says."""
    found: dict[str, list[int]] = {}
    for item in sorted(folder.glob("*.json")):
        channel = json.loads(item.read_text())
        if channel.get("kind") == "channel":
            data = (folder / channel["ring"]).read_bytes()
            found.setdefault(channel["topic"], []).extend(_stamps(data))
    return found


def _stamps(data: bytes) -> Iterator[int]:
    words = struct.unpack_from("<40Q", data)
    stride = words[STRIDE_WORD]
    if not stride:
        return
    slots = words[CAPACITY_WORD] // stride
    for number in range(words[TAIL_WORD], words[0]):
        (stamp,) = struct.unpack_from("<Q", data, HEADER + number % slots * stride + 23)
        yield stamp
