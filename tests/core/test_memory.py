"""Reading needs memory for what is asked for, not for the file."""

import struct
import subprocess
import sys
from pathlib import Path
from typing import IO

import numpy as np
import pytest

import seamlog
from seamlog import messages
from seamlog.channels import CHANNELS
from seamlog.mcap import records
from seamlog.mcap.records import ChunkEntry, Schema
from seamlog.mcap.source import FileSource
from tests.core.scenarios import START_NS, assert_same, write_live, write_numeric

PICTURE = 60 << 20
PICTURES = 70
LIMIT_KIB = 256 << 10
READ = """
import sys
import seamlog
with seamlog.open_session(sys.argv[1]) as session:
    assert session.info.message_count == {pictures} + 500, session.info.message_count
    assert len(session.columns("/table/encoder")["position_m"]) == 500
    frames = session.frames()
    assert len(frames) == {pictures}
    assert sum(len(frames[place].data) for place in range(0, {pictures}, 9)) == 8 * {size}
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(status["VmHWM"].split()[0])
"""


def write_sparse(path: Path, finished: bool) -> None:
    """A session of 4 GB: pictures that are holes of the file, encoder messages between them."""
    camera, encoder = CHANNELS["/camera/image"], CHANNELS["/table/encoder"]
    with path.open("wb") as file:
        file.write(records.MAGIC + records.header("ros2", "sparse"))
        heads = []
        for number, channel in enumerate((camera, encoder), 1):
            text = messages.definition(channel).encode()
            heads.append(records.schema(Schema(number, channel.schema, "ros2msg", text)))
            row = records.ChannelRecord(number, number, channel.topic, "cdr", {})
            heads.append(records.channel(row))
        file.write(b"".join(heads))
        entries = []
        for place in range(PICTURES):
            time = START_NS + place * 10**9
            head = messages.image_head(time, "c", "jpeg", PICTURE)
            entries.append(write_chunk(file, 1, [(time, head)], PICTURE))
            if place % 7 == 0:
                rows = [(time + 1 + k, (time, float(k), 0.0)) for k in range(50)]
                payloads = [(t, messages.encode(encoder, row)) for t, row in rows]
                entries.append(write_chunk(file, 2, payloads, 0))
        if finished:
            write_end(file, heads, entries)


def write_chunk(
    file: IO[bytes], channel: int, payloads: list[tuple[int, bytes]], hole: int
) -> ChunkEntry:
    times = [time for time, _ in payloads]
    sizes = [31 + len(payload) + hole for _, payload in payloads]
    start = file.tell()
    file.write(records.chunk_head(min(times), max(times), sum(sizes), 0, "", sum(sizes)))
    offsets = np.cumsum([0, *sizes]).tolist()
    for (time, payload), size in zip(payloads, sizes, strict=True):
        file.write(struct.pack("<BQHIQQ", records.MESSAGE, size - 9, channel, 0, time, time))
        file.write(payload)
        file.seek(hole, 1)
    length = file.tell() - start
    index = file.tell()
    rows = b"".join(struct.pack("<QQ", *row) for row in zip(times, offsets, strict=False))
    file.write(records.record(records.MESSAGE_INDEX, struct.pack("<HI", channel, len(rows)), rows))
    places = {channel: index}
    size = sum(sizes)
    behind = file.tell() - index
    return ChunkEntry(min(times), max(times), start, length, places, behind, "", size, size)


def write_end(file: IO[bytes], heads: list[bytes], entries: list[ChunkEntry]) -> None:
    file.write(records.record(records.DATA_END, bytes(4)))
    start = file.tell()
    counts = records.Statistics()
    for entry in entries:
        number = next(iter(entry.index_offsets))
        counts.add(number, 1 if number == 1 else 50, entry.start_ns, entry.end_ns)
    file.write(b"".join(heads) + b"".join(records.chunk_index(entry) for entry in entries))
    file.write(records.statistics(counts, 2, 2, 0, 0))
    file.write(records.footer(start, 0) + bytes(4) + records.MAGIC)


@pytest.mark.skipif(sys.platform != "linux", reason="holes in files and peak memory as on Linux")
@pytest.mark.parametrize("finished", [True, False])
def test_a_sparse_session_of_4_gb_stays_below_256_mib(tmp_path: Path, finished: bool) -> None:
    path = tmp_path / "large.mcap"
    write_sparse(path, finished)
    assert path.stat().st_size > 4 << 30
    script = READ.format(pictures=PICTURES, size=PICTURE)
    done = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < LIMIT_KIB


class Strict(FileSource):
    """Fails where more than one chunk is unpacked before it is given back."""

    limit = 3 << 20

    def used(self, size: int = 0) -> None:
        if size > self.limit:
            raise AssertionError(f"{size} bytes at once")
        super().used(size)


@pytest.mark.parametrize("write", [write_live, lambda path: write_numeric(path, "zstd")])
def test_no_read_is_unbounded(
    tmp_path: Path, write: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert callable(write)
    expected = write(tmp_path / "a.mcap")
    monkeypatch.setattr("seamlog.mcap.file.FileSource", Strict)
    with seamlog.open_session(tmp_path / "a.mcap") as session:
        for topic, wanted in expected.items():
            assert_same(session.columns(topic), wanted)
