"""Damaged files: what readers and `recover` keep of them, and that none of it is wrong."""

import logging
import random
import statistics
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import seamlog
from seamlog.errors import SeamlogError
from seamlog.recorder.recovery import recover
from tests.faults.damage import DAMAGES, FILES, KEYS
from tests.faults.telling import Tell

QUICK, LONG = 3, 150
MEANS = {
    "flip": "a flipped bit",
    "zeros": "a page of zeros",
    "hole": "512 bytes gone",
    "noise": "512 bytes of another file",
    "lengths": "a wrong length of a chunk",
    "cut": "its end cut off",
}
Rows = dict[str, set[tuple[object, ...]]]


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.getLogger("seamlog").setLevel(logging.CRITICAL)
    yield
    logging.getLogger("seamlog").setLevel(logging.NOTSET)


class Original(NamedTuple):
    """A whole file and all its rows."""

    name: str
    data: bytes
    rows: Rows

    @property
    def total(self) -> int:
        return sum(map(len, self.rows.values()))


@pytest.fixture(scope="module", params=sorted(FILES))
def original(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Original:
    path = tmp_path_factory.mktemp("whole") / "x.mcap"
    FILES[request.param](path)
    with seamlog.open_session(path) as session:
        return Original(request.param, path.read_bytes(), rows_of(session))


def rows_of(session: seamlog.Session) -> Rows:
    found: Rows = {}
    for topic in session.info.channels:
        columns = session.columns(topic)
        picked = zip(*(list(columns[name]) for name in KEYS[topic]), strict=True)
        found[topic] = {tuple(_plain(value) for value in row) for row in picked}
    return found


def _plain(value: object) -> object:
    return value.tobytes() if isinstance(value, np.ndarray) else value


def kept_by_readers(path: Path, original: Original) -> float:
    """Fraction of the messages; checks that nothing is wrong and that a loss is said."""
    with seamlog.open_session(path) as session:
        rows = rows_of(session)
        problems = session.problems
    return fraction(rows, bool(problems), original)


def kept_by_recovery(path: Path, original: Original) -> float:
    output = path.with_name("out.mcap")
    before = path.read_bytes()
    found = recover(path, output, force=True)
    assert path.read_bytes() == before
    with seamlog.open_session(output) as session:
        rows = rows_of(session)
    return fraction(rows, not found.is_complete, original)


def fraction(rows: Rows, is_said: bool, original: Original) -> float:
    for topic, found in rows.items():
        assert found <= original.rows[topic], f"{topic}: a wrong message"
    kept = sum(map(len, rows.values()))
    assert kept == original.total or is_said, "a loss that nobody mentions"
    return kept / original.total


def figures(original: Original, kind: str, count: int, folder: Path) -> list[tuple[float, float]]:
    path, found = folder / "damaged.mcap", []
    for seed in range(count):
        data = DAMAGES[kind](original.data, random.Random(seed))
        path.write_bytes(data)
        whole = len(data) / len(original.data) if kind == "cut" else 1.0
        pair = (kept_by_readers(path, original), kept_by_recovery(path, original))
        found.append((min(1.0, pair[0] / whole), min(1.0, pair[1] / whole)))
    return found


@pytest.mark.parametrize("kind", sorted(DAMAGES))
def test_nearly_all_is_kept_and_nothing_is_wrong(
    original: Original, kind: str, tmp_path: Path
) -> None:
    for read, recovered in figures(original, kind, QUICK, tmp_path):
        assert read >= 0.97
        assert recovered >= read


def test_a_wrong_length_that_leads_to_what_looks_like_a_record_hides_nothing(
    original: Original, tmp_path: Path
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(original.data)
    with seamlog.open_session(path) as session:
        chunks = [(row.offset, row.length) for row in session.files[0].index.chunks]
    # One byte less, and the last one is taken for the kind of the next record.
    misleading = [at for at, size in chunks if 0 < original.data[at + size - 1] <= 15]
    assert misleading
    for at in misleading[:8]:
        data = bytearray(original.data)
        length = int.from_bytes(data[at + 1 : at + 9], "little") - 1
        data[at + 1 : at + 9] = length.to_bytes(8, "little")
        path.write_bytes(data)
        assert kept_by_readers(path, original) >= 0.97
        assert kept_by_recovery(path, original) >= 0.97


@pytest.mark.parametrize("size", [8, 512, 4096])
def test_a_file_that_lost_its_first_bytes_is_read(
    original: Original, size: int, tmp_path: Path
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(bytes(size) + original.data[size:])
    assert kept_by_readers(path, original) >= 0.97
    assert kept_by_recovery(path, original) >= 0.97


def test_several_faults_at_once(original: Original, tmp_path: Path) -> None:
    path, dice = tmp_path / "x.mcap", random.Random(1)
    data = original.data
    for kind in ("flip", "zeros", "hole", "flip"):
        data = DAMAGES[kind](data, dice)
    path.write_bytes(data)
    assert kept_by_readers(path, original) >= 0.9
    assert kept_by_recovery(path, original) >= 0.9


def test_a_session_inside_a_damaged_attachment_is_not_mixed_in(
    original: Original, tmp_path: Path
) -> None:
    from seamlog.mcap.writer import FileWriter

    path = tmp_path / "x.mcap"
    with path.open("xb", buffering=0) as file:
        writer = FileWriter(file, "test")
        writer.add_attachment("other.mcap", original.data, "application/octet-stream", 1)
        writer.add_attachment("a.txt", b"whole", "text/plain", 1)
        writer.finish()
    data = bytearray(path.read_bytes())
    data[60] ^= 0x40
    path.write_bytes(data[:-40])
    with seamlog.open_session(path) as session:
        assert session.info.message_count == 0
        assert "a.txt" in session.attachments


@pytest.mark.soak
def test_the_damage_corpus(original: Original, tmp_path: Path, tell: Tell) -> None:
    for kind in sorted(DAMAGES):
        found = figures(original, kind, LONG, tmp_path)
        fault = f"{LONG} files ({original.name}), each {MEANS[kind]}"
        for name, values in zip(("read", "recovered"), zip(*found, strict=True), strict=True):
            tell(fault, f"{name}, mean", 100 * statistics.mean(values), "%", ">= 97")
            tell(fault, f"{name}, least", 100 * min(values), "%")
        tell(fault, "wrong messages, losses unsaid", 0, "", "<= 0")


@pytest.mark.soak
def test_every_cut_of_a_recording(tmp_path: Path, tell: Tell) -> None:
    from tests.core.scenarios import write_live

    whole = tmp_path / "x.mcap"
    write_live(whole, chunks=6)
    data = whole.read_bytes()
    with seamlog.open_session(whole) as session:
        original = Original("live", data, rows_of(session))
    path, most = tmp_path / "cut.mcap", 0.0
    for size in range(len(data)):
        path.write_bytes(data[:size])
        try:
            read, recovered = kept_by_readers(path, original), kept_by_recovery(path, original)
        except SeamlogError as error:
            assert str(path) in str(error)
            assert most == 0
            continue
        assert recovered >= read >= most
        most = read
    assert most == 1.0
    tell("a recording cut at each of its bytes", "cuts, nothing wrong", len(data))
