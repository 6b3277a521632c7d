"""ULog files, written here byte by byte as its format says."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import seamlog
from seamlog.cli import run
from seamlog.errors import ImportFailed
from seamlog.recorder.importers.ulog import ULogImporter

pytest.importorskip("pyulog")
BOOT_US = 1_709_528_760_000_000
FORMATS = (
    "actuator:uint64_t timestamp;float[2] control;int64_t count;uint8_t mode;uint8_t[7] _padding0;",
    "sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;",
)


def message(kind: str, content: bytes) -> bytes:
    return struct.pack("<Hc", len(content), kind.encode()) + content


def topic(number: int, name: str, instance: int = 0) -> bytes:
    return message("A", struct.pack("<BH", instance, number) + name.encode())


def actuator(number: int, place: int) -> bytes:
    values = (1_000_000 + place * 4000, place, -place, 2**53 + place, place)
    return message("D", struct.pack("<HQffqB", number, *values))


def write(path: Path, rows: int = 10, gps: int = BOOT_US, more: bytes = b"") -> Path:
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 500_000)
    flags = message("B", bytes(40))
    formats = b"".join(message("F", text.encode()) for text in FORMATS)
    parameter = message("P", bytes([11]) + b"float GAIN " + struct.pack("<f", 2.0))
    topics = topic(0, "actuator") + topic(1, "actuator", 1) + topic(2, "sensor_gps")
    topics += topic(3, "actuator", 2)
    data = b"".join(actuator(number, place) for place in range(rows) for number in (0, 1))
    if gps:
        for stamp, utc in ((1_000_000, 0), (1_500_000, gps + 1_500_000)):
            data += message("D", struct.pack("<HQQ", 2, stamp, utc))
    path.write_bytes(head + flags + formats + parameter + topics + data + more)
    return path


def load(path: Path) -> Any:
    return ULogImporter().load(path)


def test_topics_become_columns_with_times(tmp_path: Path) -> None:
    content = load(write(tmp_path / "x.ulg"))
    columns = content.columns
    assert columns["actuator/control[1]"].tolist() == [-place for place in range(10)]
    assert columns["actuator_1/count"].tolist() == [2**53 + place for place in range(10)]
    wanted = [(BOOT_US + 1_000_000 + place * 4000) * 1000 for place in range(10)]
    assert columns["actuator/time"].tolist() == wanted
    assert content.times["actuator/mode"] == "actuator/time"
    assert "times are tied to 1970 by sensor_gps" in content.notes
    assert content.notes[-1] == "1 parameters and 0 texts were not imported"


def test_without_a_date_times_count_from_the_boot(tmp_path: Path) -> None:
    content = load(write(tmp_path / "x.ulg", gps=0))
    assert content.columns["actuator/time"][0] == 1_000_000_000
    assert any("from the boot" in note for note in content.notes)


def test_dropouts_of_the_logger_are_losses(tmp_path: Path) -> None:
    content = load(write(tmp_path / "x.ulg", more=message("O", struct.pack("<H", 250)) * 2))
    assert content.losses == ["the logger itself dropped data 2 times, 0.5 s in all"]


def test_a_cut_file_gives_what_is_there(tmp_path: Path) -> None:
    path = write(tmp_path / "x.ulg", gps=0)
    path.write_bytes(path.read_bytes()[:-5])
    assert len(load(path).columns["actuator/count"]) == 10
    assert len(load(path).columns["actuator_1/count"]) == 9


def test_topics_with_damaged_times_are_left_out(tmp_path: Path) -> None:
    wild = message("D", struct.pack("<HQffqB", 0, 2**63, 0, 0, 0, 0))
    content = load(write(tmp_path / "x.ulg", more=wild))
    assert content.losses == ["topic actuator has damaged times and was left out"]
    assert "actuator_1/count" in content.columns and "actuator/count" not in content.columns


@pytest.mark.parametrize("data", [b"", b"ULog", b"no log at all" * 9])
def test_other_files_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "x.ulg").write_bytes(data)
    with pytest.raises(ImportFailed, match=r"x\.ulg"):
        load(tmp_path / "x.ulg")


def test_a_map_is_guessed_and_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, mapping = write(tmp_path / "x.ulg"), tmp_path / "m.toml"
    assert run(["import", str(path), "--guess", "-o", str(mapping)]) == 0
    words = ["import", str(path), "--map", str(mapping), "-o", str(tmp_path / "s.mcap")]
    assert run(words) == 0, capsys.readouterr()
    with seamlog.open_session(tmp_path / "s.mcap") as session:
        columns = session.columns("/import/actuator_1")
    np.testing.assert_array_equal(columns["control_0"], np.arange(10.0))
    assert columns["stamp_ns"][0] == (BOOT_US + 1_000_000) * 1000
