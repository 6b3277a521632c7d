"""Message layouts against rosbags, an independent reader of the same definitions."""

import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from seamlog.channels import CHANNELS, IMAGE_SCHEMA, Channel, markdown_table
from seamlog.messages import (
    CDR_HEADER,
    definition,
    encode,
    encode_image,
    is_fixed,
    layout,
    split_array,
)

OWN = [channel for channel in CHANNELS.values() if channel.schema.startswith("seamlog_msgs")]
FIXED = [channel for channel in OWN if is_fixed(channel)]
NUMBERS = {
    "int64": st.integers(-(2**63), 2**63 - 1),
    "uint64": st.integers(0, 2**64 - 1),
    "uint8": st.integers(0, 255),
    "float64": st.floats(allow_nan=False),
    "bool": st.booleans(),
    "string": st.text(st.characters(blacklist_characters="\x00", codec="utf-8"), max_size=20),
}


def oracle(channel: Channel, payload: bytes) -> Any:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition(channel), channel.schema))
    return store.deserialize_cdr(payload, channel.schema)


def values_of(channel: Channel) -> st.SearchStrategy[tuple[Any, ...]]:
    def one(kind: str) -> st.SearchStrategy[Any]:
        base, count = split_array(kind)
        if count is None:
            return NUMBERS[base]
        low, high = (0, 9) if count == -1 else (count, count)
        return st.lists(NUMBERS[base], min_size=low, max_size=high)

    return st.tuples(*(one(field.type) for field in channel.fields))


@pytest.mark.parametrize("channel", OWN, ids=lambda channel: channel.topic)
@settings(deadline=None)
@given(data=st.data())
def test_encoded_messages_are_read_by_rosbags(channel: Channel, data: st.DataObject) -> None:
    values = data.draw(values_of(channel))
    message = oracle(channel, encode(channel, values))
    for name, value in zip(channel.field_names, values, strict=True):
        np.testing.assert_array_equal(getattr(message, name), value)


@pytest.mark.parametrize("channel", FIXED, ids=lambda channel: channel.topic)
@settings(deadline=None)
@given(data=st.data())
def test_the_fixed_layout_packs_the_same_bytes(channel: Channel, data: st.DataObject) -> None:
    values = data.draw(values_of(channel))
    flat = [x for value in values for x in (value if isinstance(value, list) else [value])]
    found = layout(channel.topic)
    packed = CDR_HEADER + struct.pack("<" + found.codes, *flat)
    assert packed == encode(channel, values)
    assert len(packed) == found.size


def test_pictures_are_compressed_images() -> None:
    payload = encode_image(1_700_000_000_123_456_789, "camera", "jpeg", b"\xff\xd8data")
    message = oracle(CHANNELS["/camera/image"], payload)
    stamp = message.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == 1_700_000_000_123_456_789
    assert (message.header.frame_id, message.format) == ("camera", "jpeg")
    assert message.data.tobytes() == b"\xff\xd8data"
    assert CHANNELS["/camera/image"].schema == IMAGE_SCHEMA


def test_camera_info_is_read_by_rosbags() -> None:
    channel = CHANNELS["/camera/info"]
    k, r, p = list(range(9)), [0.5] * 9, list(range(12))
    values = (
        5_000_000_007,
        "cam",
        480,
        640,
        "plumb_bob",
        [0.1, 0.2],
        k,
        r,
        p,
        1,
        1,
        2,
        3,
        4,
        5,
        True,
    )
    message = oracle(channel, encode(channel, values))
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (5, 7)
    assert (message.height, message.width, message.roi.width) == (480, 640, 5)
    np.testing.assert_array_equal(message.k, k)
    np.testing.assert_array_equal(message.p, p)
    assert message.roi.do_rectify


def test_camera_info_is_the_standard_definition() -> None:
    channel = CHANNELS["/camera/info"]
    store = get_typestore(Stores.ROS2_HUMBLE)
    ours = get_types_from_msg(definition(channel), channel.schema)
    assert ours[channel.schema][1] == store.fielddefs[channel.schema][1]


@pytest.mark.parametrize("channel", OWN, ids=lambda channel: channel.topic)
def test_our_messages_begin_with_the_time_of_the_event(channel: Channel) -> None:
    assert channel.fields[0].name == "stamp_ns" and channel.fields[0].type == "int64"
    assert all(field.name == field.name.lower() for field in channel.fields)


def test_the_table_is_documented_row_by_row() -> None:
    text = markdown_table()
    assert all(f"| {topic} |" in text for topic in CHANNELS)
