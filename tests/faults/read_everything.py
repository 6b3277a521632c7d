"""Reads all of a session, or runs a command, and tells the cost.

Run as `python read_everything.py read SESSION`, or with a command line of seamlog.
"""

import logging
import sys
import time
from pathlib import Path

import seamlog
from seamlog.cli import run
from seamlog.commands.doctor import examine
from seamlog.errors import SeamlogError
from seamlog.recorder.recovery import recover

KNOWN = (SeamlogError, FileNotFoundError)


def read(path: Path) -> list[str]:
    """Everything a program may ask of a session; the errors, which are of the family."""
    errors = []
    try:
        with seamlog.open_session(path) as session:
            info = session.info
            for topic in info.channels:
                try:
                    session.columns(topic)
                except KNOWN as error:
                    errors.append(str(error))
            if "/camera/image" in info.channels:
                try:
                    for place in range(min(len(session.frames()), 3)):
                        session.frames()[place].image()
                except KNOWN as error:
                    errors.append(str(error))
            for name in session.attachments:
                try:
                    _ = session.attachments[name].data
                except KNOWN as error:
                    errors.append(str(error))
            errors += session.problems
    except KNOWN as error:
        errors.append(str(error))
    return errors


def try_all(path: Path) -> None:
    """Read `path` in every way; anything but the family's errors, each with the file, escapes."""
    for text in read(path):
        assert path.name in text or "is not there" in text or text.startswith("/"), text
    try:
        with seamlog.open_session(path) as session:
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


def main(arguments: list[str]) -> int:
    """Do it; the last line on stderr is what it cost: MiB at most, seconds of CPU."""
    if arguments[0] == "read":
        logging.disable(logging.CRITICAL)
        for text in read(Path(arguments[1])):
            print(text[:300])
        code = 0
    else:
        code = run(arguments)
    # Unlike the system's resource usage, this begins anew where the program does.
    status = Path("/proc/self/status").read_text()
    peak = int(status.split("VmHWM:")[1].split()[0]) / 1024
    print(f"{peak} {time.process_time()}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
