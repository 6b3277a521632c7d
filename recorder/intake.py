"""The recorder process' end of the tray: items of the loop become channels and records."""

from pathlib import Path
from typing import Any

from seamlog.channels import ARC_OFF, CHANNELS, EMERGENCY_STOP, FAULT, IMAGE_SCHEMA

from .feeds import ChunkSink, Feed, FixedFeed
from .folder import iter_items
from .mcap_writer import SessionFile
from .pictures import picture_encoder
from .ring import TAKEN_IN, Ring, open_ring
from .snapshot import KIND_AT, SnapshotBuffer
from .varying_feed import VaryingFeed

_URGENT = frozenset((ARC_OFF, FAULT, EMERGENCY_STOP))


class Intake:
    """Takes items in the order of their numbers, each once."""

    def __init__(
        self, folder: Path, file: SessionFile, snapshot: SnapshotBuffer | None = None
    ) -> None:
        self._folder = folder
        self._file = file
        self._snapshot = snapshot
        self._next = 1
        self.feeds: list[Feed] = []
        self.has_joined = False
        """Processes other than the loop log too."""

    def take(self) -> None:
        """Take in what has arrived; after an `OSError` the item stays and comes again."""
        for number, item in iter_items(self._folder, self._next):
            self._take(item)
            self._next = number + 1

    def _take(self, item: dict[str, Any]) -> None:
        if item["kind"] == "channel":
            self._add_channel(item)
        elif item["kind"] == "metadata":
            self._file.add_metadata(item["name"], item["values"])
        elif item["kind"] == "trigger":
            if self._snapshot is not None:
                self._snapshot.trigger(item["reason"], item["log_time_ns"])
        else:
            data = (self._folder / item["data"]).read_bytes()
            self._file.attach(item["name"], data, item["media_type"], item["log_time_ns"])
            (self._folder / item["data"]).unlink()

    def _add_channel(self, item: dict[str, Any]) -> None:
        topic, channel_id, metadata = item["topic"], item["channel_id"], item["metadata"]
        ring = open_ring(self._folder / item["ring"])
        self.has_joined |= "producer_pid" in metadata
        self._file.add_channel(topic, channel_id, metadata)
        sink: ChunkSink = self._file
        if self._snapshot is not None:
            sink = self._snapshot.sink(topic, ring)
        place = (channel_id, topic, metadata["producer"], ring, sink)
        if ring.stride:
            self.feeds.append(FixedFeed(*place))
        else:
            self.feeds.append(self._varying(topic, place))
        ring.words[TAKEN_IN] = 1

    def _varying(self, topic: str, place: tuple[int, str, str, Ring, ChunkSink]) -> VaryingFeed:
        is_picture = CHANNELS[topic].schema == IMAGE_SCHEMA
        encode = picture_encoder(place[0]) if is_picture else None
        return VaryingFeed(*place, encode, self._is_urgent if topic == "/events" else None)

    def _is_urgent(self, record: memoryview) -> bool:
        """Look at an event: is it to be on the disk at once?"""
        triggers = self._snapshot is not None and self._snapshot.see_event(record)
        return record[KIND_AT] in _URGENT or triggers
