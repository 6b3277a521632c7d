"""Whatever writes fail or fall short, wherever files end: each written chunk is read once."""

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from seamlog.recorder.folder import Recording
from seamlog.recorder.mcap_writer import SessionFile, written_files
from seamlog.recorder.pictures import message_record
from tests.recorder.sessions import read_session

TOPIC, CHANNEL_ID = "/events", 3
_real_writev = os.writev

steps = st.lists(
    st.tuples(
        st.sampled_from(["chunk", "chunk", "chunk", "fail", "short", "torn", "sync"]),
        st.integers(1, 5),
        st.integers(0, 3000),
    ),
    max_size=30,
)
"""What happens to the next write, messages of the chunk that is written, their size."""


@contextmanager
def disk(faults: list[str]) -> Iterator[None]:
    """`os.writev` that does what `faults` says for one write each."""

    def writev(descriptor: int, pieces: Sequence[bytes | memoryview]) -> int:
        fault = faults.pop() if faults else ""
        whole = b"".join(pieces)
        if fault in ("short", "torn") and len(whole) > 1:
            written = os.write(descriptor, whole[: len(whole) // 2])
            if fault == "short":
                return written
        if fault in ("fail", "torn"):
            raise OSError(5, "no")
        return _real_writev(descriptor, pieces)

    with patch.object(os, "writev", writev):
        yield


@settings(max_examples=60, deadline=None)
@given(steps)
def test_written_chunks_are_read_once_and_in_order(plan: list[tuple[str, int, int]]) -> None:
    with tempfile.TemporaryDirectory() as name:
        recording = Recording("id", str(Path(name) / "weld.mcap"), 0, "paced", None, False, 1, {})
        descriptor = os.open(recording.partial, os.O_RDWR | os.O_CREAT)
        faults: list[str] = []
        told: list[str] = []
        with disk(faults):
            file = SessionFile(recording, Path(name), descriptor, told.append)
            file.add_channel(TOPIC, CHANNEL_ID, {})
            kept, number = [], 0
            for fault, count, size in plan:
                if fault == "sync":
                    file.request_sync()
                    continue
                if fault != "chunk":
                    faults.append(fault)
                numbers = list(range(number, number + count))
                number += count
                if write(file, numbers, size):
                    kept += numbers
            faults.clear()
            assert file.finish() == []
        found = [m for path in written_files(file) for m in read_session(Path(path)).get(TOPIC, [])]
        assert [m.sequence for m in found] == kept
        assert all(len(m.data) >= 4 for m in found)
        assert not list(Path(name).glob("*.part"))


def write(file: SessionFile, numbers: list[int], size: int) -> bool:
    """Write a chunk; False if the disk did not take it."""
    records = [message_record(CHANNEL_ID, n, n, n, bytes(4 + size)) for n in numbers]
    offsets = np.cumsum([0, *map(len, records)], dtype=np.uint64)[:-1]
    times = np.array(numbers, np.uint64)
    try:
        return file.write_chunk(CHANNEL_ID, b"".join(records), times, offsets, "zstd")
    except OSError:
        return False
