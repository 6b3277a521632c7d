"""Fuzzing of the reader: `python fuzz_reader.py [libFuzzer options] CORPUS`.

Whatever the bytes are, reading, `doctor` and `recover` end with errors of the one family, and
each names the file.
"""

import logging
import sys
import tempfile
from pathlib import Path

from seamlog.commands.doctor import examine
from seamlog.errors import SeamlogError
from seamlog.recorder.recovery import recover
from seamlog.session import open_session
from tests.faults.read_everything import read


def try_all(path: Path) -> None:
    """Read `path` in every way; anything but the family's errors escapes."""
    for text in read(path):
        assert path.name in text or "is not there" in text or text.startswith("/"), text
    try:
        with open_session(path) as session:
            list(examine(session))
    except SeamlogError as error:
        assert path.name in str(error), error
    output = path.with_name("out.mcap")
    try:
        recover(path, output, force=True)
    except SeamlogError as error:
        assert path.name in str(error), error
    else:
        output.unlink()


def main() -> None:
    """Run atheris on the module as it is instrumented."""
    import atheris

    logging.disable(logging.CRITICAL)
    path = Path(tempfile.mkdtemp()) / "fuzzed.mcap"

    def one(data: bytes) -> None:
        path.write_bytes(data)
        try_all(path)

    atheris.instrument_all()
    atheris.Setup(sys.argv, one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
