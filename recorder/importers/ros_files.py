"""The files of a ROS 2 bag: which there are, which are missing, and how they are packed."""

import re
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from seamlog.errors import ImportFailed

from .content import Report

_PATHS = re.compile(r"relative_file_paths:\s*\n((?:\s+- .*\n?)+)")
_COUNTS = re.compile(r"- path: (?P<path>.*)\n(?:.*\n){1,6}?\s+message_count: (?P<count>\d+)")
_COUNTS_BEFORE = re.compile(r"message_count: (?P<count>\d+)\n(?:.*\n){0,5}?\s+path: (?P<path>.*)\n")
_BAG_FILES = (".mcap", ".db3", ".zstd")


def files_of(path: Path, report: Report) -> list[Path]:
    """Files of the bag in order; missing ones are losses."""
    if path.is_file():
        report.notes += _beside(path)
        return [path]
    names = _listed(path)
    if names is None:
        found = sorted(item for item in path.iterdir() if item.suffix in _BAG_FILES)
        if not found:
            raise ImportFailed(f"{path} is no ROS bag: no metadata.yaml, no .mcap or .db3 file")
        what = "a metadata.yaml that lists no files" if _text(path) else "no metadata.yaml"
        report.notes.append(f"{path.name} has {what}: nothing tells whether parts are missing")
        return found
    counts = counts_of(path)
    report.losses += [
        f"{name} is missing" + (f": {counts[name]} messages" if name in counts else "")
        for name in names
        if not (path / name).is_file()
    ]
    return [path / name for name in names if (path / name).is_file()]


def _text(folder: Path) -> str:
    with suppress(OSError):
        return (folder / "metadata.yaml").read_text(encoding="utf-8", errors="replace")
    return ""


def _listed(folder: Path) -> list[str] | None:
    match = _PATHS.search(_text(folder))
    return match and [_file_name(line) for line in match[1].splitlines() if line.strip()]


def counts_of(folder: Path) -> dict[str, int]:
    """Messages of each file as the bag's metadata count them."""
    text = _text(folder)
    rows = [*_COUNTS_BEFORE.finditer(text), *_COUNTS.finditer(text)]
    return {_file_name(row["path"]): int(row["count"]) for row in rows}


def _beside(path: Path) -> list[str]:
    """A note if a bag's metadata names more files than the one that was asked for."""
    names = _listed(path.parent) or []
    if path.name not in names or len(names) < 2:
        return []
    return [f"{path.name} is one of {len(names)} files of a bag; name its folder to import all"]


def _file_name(line: str) -> str:
    return Path(line.strip().removeprefix("- ").strip("\"' ")).name


def is_compressed_by_message(path: Path) -> bool:
    """Whether each message of the bag is packed on its own."""
    text = _text(path if path.is_dir() else path.parent)
    return bool(re.search(r"compression_mode:\s*[\"']?message", text, re.IGNORECASE))


@contextmanager
def plain(file: Path, report: Report) -> Iterator[Path]:
    """The file itself, what is packed in a `.zstd` file, or a database with its journal."""
    journal = Path(f"{file}-wal")
    has_journal = file.suffix == ".db3" and journal.is_file() and journal.stat().st_size > 0
    if file.suffix != ".zstd" and not has_journal:
        yield file
        return
    with tempfile.TemporaryDirectory() as folder:
        if has_journal:
            report.notes.append(f"{journal.name} holds the last messages; they were taken, too")
            yield _with_journal(file, journal, Path(folder))
        else:
            yield _unpacked(file, Path(folder) / file.stem)


def _with_journal(file: Path, journal: Path, folder: Path) -> Path:
    """A copy into which SQLite has written the journal that a killed recorder left."""
    whole = Path(shutil.copy(file, folder))
    shutil.copy(journal, folder)
    try:
        connection = sqlite3.connect(whole)
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        connection.execute("PRAGMA journal_mode = DELETE")
        connection.close()
    except sqlite3.Error as error:
        raise ImportFailed(f"{file} and its journal do not fit together: {error}") from error
    return whole


def _unpacked(file: Path, target: Path) -> Path:
    import zstandard

    try:
        with file.open("rb") as packed, target.open("wb") as unpacked:
            zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
    except zstandard.ZstdError as error:
        raise ImportFailed(f"{file} cannot be unpacked: {error}") from error
    return target
