"""Every scenario, read by seamlog and by the readers of others."""

import json
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

import seamlog
from seamlog import messages
from seamlog.channels import CHANNELS
from tests.core.scenarios import SCENARIOS, Expected, assert_same, times

OWN = ("numeric_zstd", "numeric_lz4", "numeric_uncompressed", "events_and_paths", "live")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Expected]]:
    folder = tmp_path_factory.mktemp("scenarios")
    return {
        name: (folder / f"{name}.mcap", make(folder / f"{name}.mcap"))
        for name, make in SCENARIOS.items()
    }


@pytest.mark.parametrize("name", SCENARIOS)
def test_seamlog_reads(made: dict[str, tuple[Path, Expected]], name: str) -> None:
    path, expected = made[name]
    with seamlog.open_session(path) as session:
        assert set(session.info.channels) == set(expected)
        for topic, columns in expected.items():
            found = session.columns(topic)
            assert_same(found, columns)
            assert session.info.channels[topic].count == len(found["log_time_ns"])
        assert session.problems == []


@pytest.mark.parametrize("name", SCENARIOS)
def test_fields_and_windows_agree_with_all(
    made: dict[str, tuple[Path, Expected]], name: str
) -> None:
    path, expected = made[name]
    with seamlog.open_session(path) as session:
        for topic in expected:
            whole = session.columns(topic)
            log = whole["log_time_ns"]
            start, end = int(log[len(log) // 3]), int(log[-1])
            inside = (log >= start) & (log < end)
            field = list(whole)[-1]
            part = session.window(start, end).columns(topic, [field])
            assert set(part) <= {field, "log_time_ns", "stamp_ns"}
            assert_same(part, {field: whole[field][inside], "log_time_ns": log[inside]})


@pytest.mark.parametrize("name", OWN)
def test_mcap_reads(made: dict[str, tuple[Path, Expected]], name: str) -> None:
    path, expected = made[name]
    seen: dict[str, list[int]] = {topic: [] for topic in expected}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for _, channel, message in reader.iter_messages():
            seen[channel.topic].append(message.log_time)
        summary = reader.get_summary()
        attachments = [item.name for item in reader.iter_attachments()]
    for topic, columns in expected.items():
        assert len(seen[topic]) == len(columns["stamp_ns"])
        assert_same({"log_time_ns": np.array(seen[topic])}, _only_log_times(columns))
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == sum(map(len, seen.values()))
    assert attachments == (["photo/a.jpg"] if name == "live" else [])


def _only_log_times(columns: dict[str, object]) -> dict[str, object]:
    return {key: value for key, value in columns.items() if key == "log_time_ns"}


@pytest.mark.parametrize("name", OWN)
def test_rosbags_decodes_the_same(made: dict[str, tuple[Path, Expected]], name: str) -> None:
    path, expected = made[name]
    with seamlog.open_session(path) as session, AnyReader([path]) as reader:
        found = {topic: session.columns(topic) for topic in expected}
        places: Counter[str] = Counter()
        for connection, log_time, raw in reader.messages():
            topic = connection.topic
            place = places[topic]
            places[topic] += 1
            if place % 101:
                continue
            message = reader.deserialize(raw, connection.msgtype)
            assert found[topic]["log_time_ns"][place] == log_time
            for field, column in found[topic].items():
                value = message
                for part in field.split("."):
                    value = getattr(value, part, None)
                if value is not None:
                    np.testing.assert_array_equal(column[place], value, err_msg=field)
        assert places == {topic: len(columns["stamp_ns"]) for topic, columns in expected.items()}


@pytest.mark.parametrize("name", ["numeric_zstd", "events_and_paths", "live"])
def test_the_javascript_reader_reads(
    made: dict[str, tuple[Path, Expected]],
    name: str,
    node: str,
    node_modules: Path,
    project: Path,
) -> None:
    path, expected = made[name]
    command = [node, str(project / "tests" / "js" / "read_mcap.mjs"), str(path)]
    found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    assert found["profile"] == "ros2"
    counts = {topic: seen["count"] for topic, seen in found["topics"].items()}
    assert counts == {topic: len(columns["stamp_ns"]) for topic, columns in expected.items()}


@pytest.mark.parametrize("numbered", [True, False])
def test_order_is_that_of_capture_whatever_the_clock_did(tmp_path: Path, numbered: bool) -> None:
    """A clock that steps back keeps the order; jumbled times without numbers are sorted."""
    encoder = CHANNELS["/table/encoder"]
    stamps = times(40).tolist()
    log = [time if place < 20 else time - 3_000_000_000 for place, time in enumerate(stamps)]
    with (tmp_path / "x.mcap").open("xb") as file:
        writer = Writer(file, chunk_size=500)
        writer.start("ros2", "test")
        text = messages.definition(encoder).encode()
        schema = writer.register_schema(encoder.schema, "ros2msg", text)
        channel = writer.register_channel(encoder.topic, "cdr", schema)
        for place, (time, stamp) in enumerate(zip(log, stamps, strict=True)):
            payload = messages.encode(encoder, (stamp, float(place), 0.0))
            writer.add_message(channel, time, payload, stamp, place + 1 if numbered else 0)
        writer.finish()  # type: ignore[no-untyped-call]
    with seamlog.open_session(tmp_path / "x.mcap") as session:
        found = session.columns(encoder.topic)["stamp_ns"].tolist()
        assert (found == stamps) == numbered
        assert any("stepped back" in problem for problem in session.problems) == numbered
