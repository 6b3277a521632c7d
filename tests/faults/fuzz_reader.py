"""Guided fuzzing of the reader: `python fuzz_reader.py [libFuzzer options] CORPUS`."""

import logging
import sys
import tempfile
from pathlib import Path


def main() -> None:
    """Feed what atheris makes up to every way of reading."""
    import atheris

    with atheris.instrument_imports(include=["seamlog"]):
        from tests.faults.read_everything import try_all
    logging.disable(logging.CRITICAL)
    path = Path(tempfile.mkdtemp()) / "fuzzed.mcap"

    def one(data: bytes) -> None:
        path.write_bytes(data)
        try_all(path)

    atheris.Setup(sys.argv, one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
