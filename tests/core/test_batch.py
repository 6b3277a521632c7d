"""Writing sessions from columns, and copying them."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import seamlog
from seamlog import messages
from seamlog.channels import CHANNELS, Channel, Field
from seamlog.errors import OutputExists, UnknownName, UsageError
from seamlog.mcap.batch import BatchWriter
from seamlog.messages import split_array
from tests.core.scenarios import (
    SCENARIOS,
    Expected,
    assert_same,
    encoder_columns,
    picture,
    times,
    write_live,
    write_numeric,
)

FIXED = [channel for channel in CHANNELS.values() if messages.is_fixed(channel)]


@st.composite
def batches(draw: st.DrawFn) -> tuple[Channel, dict[str, Any], Any]:
    channel = draw(st.sampled_from(FIXED))
    count = draw(st.integers(0, 40))
    columns = {}
    for field in channel.fields:
        base, width = split_array(field.type)
        kind = np.dtype({"bool": "?", "byte": "u1"}.get(base, base))
        shape = (count,) if width is None else (count, width)
        columns[field.name] = draw(hnp.arrays(kind, shape))
    log = draw(hnp.arrays(np.int64, count, elements=st.integers(0, 2**63 - 2)))
    return channel, columns, log


@settings(max_examples=60, deadline=None)
@given(batches(), st.sampled_from(["zstd", "lz4", ""]))
def test_what_is_written_is_read(
    batch: tuple[Channel, dict[str, Any], Any], compression: str
) -> None:
    channel, columns, log = batch
    in_order = np.argsort(log, kind="stable")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        with BatchWriter(path, compression=compression) as writer:
            writer.write(channel.topic, columns, log)
        with seamlog.open_session(path) as session:
            found = session.columns(channel.topic)
            # few steps back count as a clock that was set: then the order of writing stays
            order = np.arange(len(log)) if session.problems else in_order
    for name, values in columns.items():
        assert found[name].dtype == values.dtype
        np.testing.assert_array_equal(found[name], values[order])
    np.testing.assert_array_equal(found["log_time_ns"], log[order])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"position_m": np.zeros(3)}, "different lengths"),
        ({"extra_m": np.zeros(4)}, "extra_m"),
        ({"position_m": np.zeros((4, 2))}, "shape"),
        ({"stamp_ns": np.arange(4.0)}, "float64"),
        ({"position_m": np.array(list("abcd"))}, "<U1"),
        ({"stamp_ns": np.arange(4) - 9}, "before 1970"),
    ],
)
def test_columns_that_do_not_fit_leave_no_file(
    tmp_path: Path, change: dict[str, Any], reason: str
) -> None:
    with pytest.raises(UsageError, match=reason), BatchWriter(tmp_path / "x.mcap") as writer:
        writer.write("/table/encoder", encoder_columns(4) | change)
    assert list(tmp_path.iterdir()) == []


def test_values_outside_their_type_are_refused(tmp_path: Path) -> None:
    flags = Channel("/flags", "x/msg/X", (*FIXED[0].fields[:1], Field("uint8", "a", "", "")), 1, "")
    with pytest.raises(UsageError, match="outside uint8"), BatchWriter(tmp_path / "x.mcap") as w:
        w.write_as("/flags", flags, {"stamp_ns": times(2), "a": np.array([1, 300])})


def test_topics_outside_the_table_and_variable_ones_are_refused(tmp_path: Path) -> None:
    with BatchWriter(tmp_path / "x.mcap") as writer:
        with pytest.raises(UnknownName, match="/what"):
            writer.write("/what", {})
        with pytest.raises(UsageError, match="write_payloads"):
            writer.write("/events", {"stamp_ns": times(1)})


def test_a_session_is_not_overwritten_unless_forced(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(b"old")
    with pytest.raises(OutputExists), BatchWriter(path):
        pass
    assert path.read_bytes() == b"old"
    with BatchWriter(path, force=True):
        pass
    with seamlog.open_session(path) as session:
        assert session.info.message_count == 0


def test_several_writes_make_one_channel(tmp_path: Path) -> None:
    columns = encoder_columns(10)
    with BatchWriter(tmp_path / "x.mcap") as writer:
        for part in (slice(0, 4), slice(4, 10)):
            writer.write("/table/encoder", {name: c[part] for name, c in columns.items()})
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        assert_same(session.columns("/table/encoder"), columns)
        assert len(session.files[0].index.channels) == 1


def read(path: Path, expected: Expected) -> None:
    with seamlog.open_session(path) as session:
        for topic, columns in expected.items():
            assert_same(session.columns(topic), columns)
        assert session.problems == []


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_copy_holds_the_same(tmp_path: Path, name: str) -> None:
    expected = SCENARIOS[name](tmp_path / "a.mcap")
    with seamlog.open_session(tmp_path / "a.mcap") as session:
        attachments = dict(session.attachments)
        with BatchWriter(tmp_path / "b.mcap") as writer:
            writer.copy_session(session)
    read(tmp_path / "b.mcap", expected)
    with seamlog.open_session(tmp_path / "b.mcap") as copy:
        assert dict(copy.attachments) == attachments


def test_sessions_with_the_same_ids_are_copied_into_one(tmp_path: Path) -> None:
    one = write_live(tmp_path / "a.mcap")
    two = write_numeric(tmp_path / "b.mcap", "zstd", 100)
    own = {"stamp_ns": times(3), "x_px": np.arange(3.0), "y_px": np.arange(3.0)}
    with BatchWriter(tmp_path / "c.mcap") as writer:
        writer.write("/robot/marker", own)
        for name in ("a.mcap", "b.mcap"):
            with seamlog.open_session(tmp_path / name) as session:
                writer.copy_session(session)
    both = {topic: one[topic] for topic in ("/camera/image",)}
    both |= {topic: two[topic] for topic in ("/table/command", "/replay/pd/state")}
    read(tmp_path / "c.mcap", both | {"/robot/marker": own})
    with seamlog.open_session(tmp_path / "c.mcap") as session:
        assert session.info.channels["/table/encoder"].count == 100 + 18


def test_a_window_is_no_session_to_copy(tmp_path: Path) -> None:
    write_live(tmp_path / "a.mcap")
    with (
        seamlog.open_session(tmp_path / "a.mcap") as session,
        pytest.raises(UsageError, match="window"),
        BatchWriter(tmp_path / "b.mcap") as writer,
    ):
        writer.copy_session(session.window(0, 10))
    assert not (tmp_path / "b.mcap").exists()


def test_a_copy_of_a_damaged_session_says_so(tmp_path: Path) -> None:
    write_live(tmp_path / "a.mcap")
    data = (tmp_path / "a.mcap").read_bytes()
    place = data.index(picture(1)) + 9
    (tmp_path / "a.mcap").write_bytes(data[:place] + b"?" + data[place + 1 :])
    with (
        seamlog.open_session(tmp_path / "a.mcap") as session,
        BatchWriter(tmp_path / "b.mcap") as writer,
    ):
        writer.copy_session(session)
    with seamlog.open_session(tmp_path / "b.mcap") as copy:
        assert len(copy.columns("/camera/image")["stamp_ns"]) == 5
        assert any("copied" in text and "CRC" in text for text in copy.info.problems)
