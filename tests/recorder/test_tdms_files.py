"""TDMS files that were cut, interleaved, or hold waveforms of several kinds."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from seamlog.errors import ImportFailed
from seamlog.recorder.importers.tdms import TdmsImporter

X = np.sin(np.arange(50) / 10)
START = np.datetime64("2024-03-04T05:06:07.123456", "us")
START_NS = 1_709_528_767_123_456_000
WAVE = {"wf_start_time": START, "wf_increment": 0.01, "wf_start_offset": 0.0}


def write(path: Path, *segments: list[ChannelObject]) -> Path:
    with TdmsWriter(str(path)) as writer:
        for segment in segments:
            writer.write_segment(segment)
    return path


def load(path: Path) -> Any:
    return TdmsImporter().load(path)


@pytest.fixture
def two(tmp_path: Path) -> Path:
    slow = WAVE | {"wf_increment": 0.1}
    channels = [ChannelObject("fast", "a", X, WAVE), ChannelObject("slow", "b", X[:10], slow)]
    return write(tmp_path / "two.tdms", channels)


def test_groups_of_different_rate_keep_their_own_times(two: Path) -> None:
    content = load(two)
    assert content.times == {"fast/a": "fast/a time", "slow/b": "slow/b time"}
    assert np.diff(content.columns["slow/b time"]).tolist() == [100_000_000] * 9
    assert content.columns["fast/a time"][0] == START_NS


def test_a_file_that_is_cut_says_how_many_values_are_missing(two: Path) -> None:
    data = two.read_bytes()
    two.write_bytes(data[:-100])
    content = load(two)
    assert content.losses == [
        "the file is cut: the last 3 values of channel /'fast'/'a' are missing",
        "the file is cut: the last 10 values of channel /'slow'/'b' are missing",
    ]
    np.testing.assert_array_equal(content.columns["fast/a"], X[:47])
    two.write_bytes(data[:12] + b"\xff" * 8 + data[20:])  # as LabVIEW leaves it when it is killed
    assert load(two).losses == []
    np.testing.assert_array_equal(load(two).columns["slow/b"], X[:10])


@pytest.mark.parametrize(("size", "said"), [(0, "is empty"), (60, "cut within its head")])
def test_heads_of_files_are_refused(two: Path, size: int, said: str) -> None:
    two.write_bytes(two.read_bytes()[:size])
    with pytest.raises(ImportFailed, match=said):
        load(two)


def test_a_waveform_that_begins_anew_states_no_times(tmp_path: Path) -> None:
    later = WAVE | {"wf_start_time": START + np.timedelta64(9, "s")}
    parts = [[ChannelObject("g", "a", X, wave)] for wave in (WAVE, later)]
    content = load(write(tmp_path / "x.tdms", *parts))
    assert not content.times and len(content.columns["g/a"]) == 100
    assert "changes within the file" in content.notes[0]
    same = load(write(tmp_path / "y.tdms", parts[0], parts[0]))
    assert same.columns["g/a time"][-1] == START_NS + 99 * 10_000_000


def test_a_channel_named_as_our_times_keeps_its_values(tmp_path: Path) -> None:
    channels = [ChannelObject("g", "a", X, WAVE), ChannelObject("g", "a time", 2 * X)]
    content = load(write(tmp_path / "x.tdms", channels))
    np.testing.assert_array_equal(content.columns["g/a time"], 2 * X)
    assert content.times == {"g/a": "g/a time of waveform"}


def test_a_spectrum_is_no_waveform(tmp_path: Path) -> None:
    over = {"wf_increment": 10.0, "wf_xname": "Frequency", "wf_xunit_string": "Hz"}
    content = load(write(tmp_path / "x.tdms", [ChannelObject("g", "f", X, over)]))
    assert not content.times
    assert "over Hz, not over time" in content.notes[0]


def test_scaled_and_interleaved_channels(tmp_path: Path) -> None:
    scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled"}
    linear = {"Scale_Type": "Linear", "Linear_Slope": 0.5, "Linear_Y_Intercept": 1.0}
    scale |= {f"NI_Scale[0]_{key}": value for key, value in linear.items()}
    scale["NI_Scale[0]_Linear_Input_Source"] = 0xFFFFFFFF
    raw = np.arange(50, dtype=np.int16)
    content = load(write(tmp_path / "x.tdms", [ChannelObject("g", "a", raw, scale)]))
    np.testing.assert_array_equal(content.columns["g/a"], raw * 0.5 + 1)
    (tmp_path / "y.tdms").write_bytes(interleaved())
    columns = load(tmp_path / "y.tdms").columns
    np.testing.assert_array_equal(columns["g/b"], 2 * X)


def interleaved() -> bytes:
    """Two channels of doubles, sample by sample."""
    head = struct.pack("<I", 2)
    for name in ("a", "b"):
        text = f"/'g'/'{name}'".encode()
        head += struct.pack("<I", len(text)) + text
        head += struct.pack("<IIIQI", 20, 10, 1, len(X), 0)
    values = np.column_stack([X, 2 * X]).tobytes()
    lead = struct.pack("<IIQQ", 2 | 4 | 8 | 32, 4713, len(head) + len(values), len(head))
    return b"TDSm" + lead + head + values
