"""Any bytes at all in messages, definitions and foreign files: only errors of the one family."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from tests.core.protobuf_schemas import everything
from tests.core.test_protobuf import joints
from tests.faults.fuzz import edited, fuzz
from tests.faults.fuzz_decoders import GRAMMARS, TEXT, attempt, readers, seeds
from tests.faults.telling import Tell
from tests.recorder.test_ulog_files import write as write_ulog

EDITS = st.lists(
    st.tuples(st.floats(0, 1), st.integers(0, 9), st.binary(max_size=9)), min_size=1, max_size=4
)


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> dict[int, bytes]:
    """An input of each kind that is read without a word, by the number of its reader."""
    folder = tmp_path_factory.mktemp("valid")
    numbers = np.arange(20.0)
    scipy.io.savemat(folder / "x.mat", {"a": numbers, "s": {"b": numbers}})
    pq.write_table(pa.table({"a": numbers, "b": numbers > 3}), folder / "x.parquet")
    with TdmsWriter(folder / "x.tdms") as tdms:
        wave = {"wf_start_time": np.datetime64("2024-01-01", "us"), "wf_increment": 0.1}
        tdms.write_segment([ChannelObject("g", "c", numbers, properties=wave)])
    files = [(folder / f"x.{suffix}").read_bytes() for suffix in ("mat", "parquet", "tdms")]
    message = joints(1, 2).SerializeToString()
    cdr = b"\x27\x00\x01\x00\x00" + bytes(60)
    messages = [cdr] * 4 + [bytes([len(message) - 1]) + message] * 4
    definitions = [TEXT, b"module p { module msg { struct Outer { double x; }; }; };"]
    definitions.append(everything().SerializeToString())
    inputs = [
        *messages,
        *definitions,
        b"t,x\n0,1\n1,2\n",
        *files,
        bag1(folder / "x.bag"),
        bag2(folder / "bag"),
        write_ulog(folder / "x.ulg").read_bytes(),
    ]
    return dict(enumerate(inputs))


def bag1(path: Path) -> bytes:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        connection = writer.add_connection("/s", "std_msgs/msg/String", typestore=store)
        raw = store.serialize_ros1(store.types["std_msgs/msg/String"]("abc"), "std_msgs/msg/String")
        writer.write(connection, 1, raw)
    return path.read_bytes()


def bag2(path: Path) -> bytes:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(path, version=9) as writer:
        connection = writer.add_connection("/s", "std_msgs/msg/String", typestore=store)
        raw = store.serialize_cdr(store.types["std_msgs/msg/String"]("abc"), "std_msgs/msg/String")
        writer.write(connection, 1, raw)
    return next(path.glob("*.db3")).read_bytes()


def test_valid_inputs_are_read(valid: dict[int, bytes], tmp_path: Path) -> None:
    known = readers(tmp_path / "x.bin")
    assert len(known) == len(valid) == 2 * len(GRAMMARS) + 10
    for number in range(2 * len(GRAMMARS), len(known)):
        known[number](valid[number])


@settings(max_examples=250, deadline=None, suppress_health_check=list(HealthCheck))
@given(which=st.integers(0, 16), edits=EDITS)
def test_edited_inputs(valid: dict[int, bytes], tmp_path: Path, which: int, edits: Any) -> None:
    attempt(readers(tmp_path / "x.bin")[which], edited(valid[which], edits))


@settings(max_examples=250, deadline=None, suppress_health_check=list(HealthCheck))
@given(which=st.integers(0, 16), data=st.binary(max_size=120))
def test_any_bytes(tmp_path: Path, which: int, data: bytes) -> None:
    attempt(readers(tmp_path / "x.bin")[which], data)


@pytest.mark.soak
def test_guided_fuzzing_of_decoders(
    valid: dict[int, bytes], tmp_path: Path, project: Path, tell: Tell
) -> None:
    fuzz("decoders", seeds(valid), tmp_path, project, tell)
