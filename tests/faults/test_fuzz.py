"""Any bytes at all: reading, `doctor` and `recover` end in the one family of errors."""

import logging
import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.core.scenarios import write_foreign, write_live
from tests.faults.fuzz import Edit, edited, fuzz
from tests.faults.read_everything import try_all
from tests.faults.telling import Tell

LONG = 5000
EDITS = st.lists(
    st.tuples(st.floats(0, 1), st.integers(0, 24), st.binary(max_size=16)), min_size=1, max_size=6
)


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.getLogger("seamlog").setLevel(logging.CRITICAL)
    yield
    logging.getLogger("seamlog").setLevel(logging.NOTSET)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    folder = tmp_path_factory.mktemp("whole")
    write_live(folder / "live.mcap", chunks=3)
    write_foreign(folder / "bag.mcap", {"chunk_size": 500}, 12)
    write_foreign(folder / "bare.mcap", {"use_chunking": False}, 6)
    return [path.read_bytes() for path in sorted(folder.iterdir())]


@settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
@given(which=st.integers(0, 2), edits=EDITS)
@example(which=0, edits=[(0.5, 0, b"\x89MCAP0\r\n")])
def test_edited_files(files: list[bytes], tmp_path: Path, which: int, edits: list[Edit]) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(edited(files[which], edits))
    try_all(path)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.binary(max_size=200))
def test_bytes_behind_the_magic(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + data)
    try_all(path)


@pytest.mark.soak
def test_many_edited_files(files: list[bytes], tmp_path: Path, tell: Tell) -> None:
    path = tmp_path / "x.mcap"
    for seed in range(LONG):
        dice = random.Random(seed)
        edits = [
            (dice.random(), dice.randrange(24), dice.randbytes(dice.randrange(12)))
            for _ in range(dice.randrange(1, 6))
        ]
        path.write_bytes(edited(files[seed % 3], edits))
        try_all(path)
    tell("files edited at random", "read, each error in the family, with the file", LONG)


@pytest.mark.soak
def test_guided_fuzzing(files: list[bytes], tmp_path: Path, project: Path, tell: Tell) -> None:
    fuzz("reader", files, tmp_path, project, tell)
