"""Guided fuzzing by atheris: `python fuzz.py TARGET [libFuzzer options] CORPUS`, and who calls it.

TARGET is `reader` or `decoders`. Whatever the bytes are, only errors of the one family come out.
"""

import logging
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import pytest

from tests.faults.telling import Tell

SECONDS = 240
Edit = tuple[float, int, bytes]
"""A place from 0 to 1 of the input, bytes removed there, bytes put there."""


def edited(data: bytes, edits: Iterable[Edit]) -> bytes:
    """`data` with each of `edits` done."""
    for place, removed, added in edits:
        at = int(place * len(data))
        data = data[:at] + added + data[at + removed :]
    return data


def fuzz(target: str, seeds: Iterable[bytes], folder: Path, project: Path, tell: Tell) -> None:
    """Fuzz `target` in a process of its own, from `seeds` on; fails with what it found."""
    pytest.importorskip("atheris")
    corpus = folder / "corpus"
    corpus.mkdir()
    for number, data in enumerate(seeds):
        (corpus / str(number)).write_bytes(data)
    options = [f"-max_total_time={SECONDS}", "-rss_limit_mb=2500", f"-artifact_prefix={folder}/"]
    fuzzed = subprocess.run(
        [sys.executable, __file__, target, *options, str(corpus)],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        env=os.environ | {"PYTHONPATH": str(project)},
    )
    assert fuzzed.returncode == 0, fuzzed.stderr[-4000:]
    runs = re.search(r"Done (\d+) runs", fuzzed.stderr)
    assert runs is not None, fuzzed.stderr[-4000:]
    tell(f"guided fuzzing of the {target}, {SECONDS} s", "inputs, each in the family", int(runs[1]))


def main(target: str, options: list[str]) -> None:
    """Feed what atheris makes up to `target`."""
    import atheris

    with atheris.instrument_imports(include=["seamlog", "rosbags", "nptdms"]):
        from tests.faults.fuzz_decoders import attempt, readers
        from tests.faults.read_everything import try_all
    logging.disable(logging.CRITICAL)
    path = Path(tempfile.mkdtemp()) / "fuzzed.mcap"
    known = readers(path)

    def read(data: bytes) -> None:
        path.write_bytes(data)
        try_all(path)

    def decode(data: bytes) -> None:
        if data:
            attempt(known[data[0] % len(known)], data[1:])

    atheris.Setup([sys.argv[0], *options], {"reader": read, "decoders": decode}[target])
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
