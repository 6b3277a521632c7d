"""Hostile files: bounded memory and time, and the limit that was met has a name."""

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.faults.hostile import MAKERS
from tests.faults.telling import Tell

READ = Path(__file__).with_name("read_everything.py")
MOST_MIB, MOST_CPU_S = 512, 2.0
NAMED = {
    "bomb_that_says_so": "limit chunk_bytes",
    "bomb_that_lies_zstd": "more bytes than the 1000",
    "bomb_that_lies_lz4": "more bytes than the 1000",
    "many_bombs": "limit expansion",
    "index_of_one_chunk_many_times": "more chunks than fit",
    "strings_of_four_gigabytes": "bytes wanted",
    "sequence_of_four_billion": "does not fit its definition",
    "definition_that_holds_itself": "nested more than",
    "picture_of_a_billion_pixels": "limit image_pixels",
}


class Cost(NamedTuple):
    """What a program took; `text` is all it printed."""

    code: int
    mib: float
    cpu_s: float
    text: str


def cost(*arguments: str) -> Cost:
    found = subprocess.run(
        [sys.executable, str(READ), *arguments], capture_output=True, text=True, check=False
    )
    *said, last = found.stderr.splitlines() or [""]
    assert len(last.split()) == 2, found.stderr
    mib, cpu_s = map(float, last.split())
    return Cost(found.returncode, mib, cpu_s, found.stdout + "\n".join(said))


def costs(path: Path) -> dict[str, Cost]:
    output = str(path.with_name("out.mcap"))
    return {
        "read": cost("read", str(path)),
        "info": cost("info", str(path)),
        "doctor": cost("doctor", str(path)),
        "recover": cost("recover", str(path), "-o", output, "--force"),
    }


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_hostile_files_are_bounded(tmp_path: Path, name: str) -> None:
    path = tmp_path / "x.mcap"
    MAKERS[name](path)
    read = cost("read", str(path))
    assert read.code == 0, read.text
    assert read.mib <= MOST_MIB
    assert str(path) in read.text
    assert NAMED.get(name, "") in read.text
    doctor = cost("doctor", str(path))
    assert doctor.code in (0, 1, 3), doctor.text
    assert doctor.mib <= MOST_MIB


@pytest.mark.soak
def test_the_cost_of_hostile_files(tmp_path: Path, tell: Tell) -> None:
    for name, make in sorted(MAKERS.items()):
        path = tmp_path / f"{name}.mcap"
        make(path)
        found = costs(path)
        assert all(row.code in (0, 1, 3) for row in found.values()), found
        fault = f"hostile file: {name.replace('_', ' ')}"
        most = max(row.mib for row in found.values())
        tell(fault, f"memory, most of {', '.join(found)}", most, "MiB", f"<= {MOST_MIB}")
        most = max(row.cpu_s for row in found.values())
        tell(fault, "time, most of the same", most, "s", f"<= {MOST_CPU_S:g}")
