"""Writing a file whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from seamlog.errors import InputError, OutputExists


def check_output(path: Path, force: bool) -> None:
    """Refuse to replace `path` unless `force`; the folder must exist."""
    if path.exists() and not force:
        raise OutputExists(f"{path} is there already; give another name or --force")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; make it first")


@contextmanager
def replacing(path: Path, force: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`; sync and rename it on success, remove it on failure."""
    check_output(path, force)
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield partial
        with partial.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes, force: bool = True) -> None:
    """Write `data` to `path`, whole or not at all."""
    with replacing(path, force) as partial:
        partial.write_bytes(data)


def is_being_written(path: Path) -> bool:
    """True while a recorder process holds its lock on `path`."""
    try:
        import fcntl
    except ImportError:
        return False
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False
