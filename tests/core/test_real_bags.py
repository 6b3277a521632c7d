"""Bags that ROS 2 itself wrote, against the decoding of rosbags."""

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import seamlog

BAGS = ("cdr_test", "talker", "wbag")


def same(found: Any, wanted: Any) -> None:
    if isinstance(found, list):
        assert len(found) == len(wanted)
        for one, other in zip(found, wanted, strict=True):
            same(one, other)
    elif getattr(wanted, "dtype", None) == np.int8:
        # rosbags takes `byte` arrays as signed; ROS 2 says octets
        np.testing.assert_array_equal(np.asarray(found).view(np.int8), wanted)
    else:
        np.testing.assert_array_equal(found, wanted)


def attribute(message: Any, name: str) -> Any:
    for part in name.split("."):
        if isinstance(message, list):
            message = [getattr(item, part) for item in message]
        else:
            message = getattr(message, part)
    return message


@pytest.mark.parametrize("bag", BAGS)
def test_all_messages_decode_as_rosbags_says(data_dir: Path, bag: str) -> None:
    folder = data_dir / "mcap" / bag
    wanted: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    # by file: through the talker's folder rosbags finds no message at all
    with AnyReader(sorted(folder.glob("*.mcap"))) as reader:
        for connection, log_time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            wanted[connection.topic].append((log_time, message))
    compared = 0
    with seamlog.open_session(folder) as session:
        for topic in session.info.channels:
            columns = session.columns(topic)
            times = columns.pop("log_time_ns")
            columns.pop("stamp_ns", None)
            assert times.tolist() == [time for time, _ in wanted[topic]]
            for name, column in columns.items():
                for found, (_, message) in zip(column, wanted[topic], strict=True):
                    same(found, attribute(message, name))
                    compared += 1
        assert session.problems == []
    assert compared > 0
