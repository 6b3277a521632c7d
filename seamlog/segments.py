"""The files of one session: `weld.mcap`, `weld.0002.mcap` and so on, one recording id in all."""

import re
from collections.abc import Sequence
from pathlib import Path

from seamlog.errors import SessionError
from seamlog.limits import Limits
from seamlog.mcap.file import McapFile

RECORDING = "seamlog.recording"
"""Metadata record of every session file: `id` of the recording, `index` of the file from 1."""
PROBLEMS = "seamlog.problems"
"""Metadata record of a copy: what was missing or damaged in the session that was copied."""
_SEGMENT = re.compile(r"(?P<stem>.+?)(?:\.\d{4,})?\.mcap(?:\.part)?")

_RINGS = re.compile(r"/dev/shm/seamlog-\d+/[0-9a-f]{32}")
"""Where the rings of a recording are, as its metadata says; no other path is touched."""


def segment_path(first: Path, number: int) -> Path:
    """Name of file `number` (from 1) of the session whose first file is `first`."""
    return first if number == 1 else first.with_name(f"{first.stem}.{number:04d}{first.suffix}")


def find_segments(path: str | Path | Sequence[str | Path], limits: Limits) -> list[McapFile]:
    """Open all files of the session that `path` names, in their order."""
    if not isinstance(path, str | Path):
        return _ordered([McapFile(Path(item), limits) for item in path], "the list")
    path = Path(path)
    if path.is_dir():
        inside = sorted(path.glob("*.mcap")) or sorted(path.glob("*.mcap.part"))
        if not inside:
            raise SessionError(f"{path} is a folder without an .mcap file; name a session file")
        return _ordered([McapFile(item, limits) for item in inside], str(path))
    unfinished = path.with_name(path.name + ".part")
    if not path.exists() and unfinished.exists():
        path = unfinished
    first = McapFile(path, limits)
    if _identity(first)[0] is None:
        return [first]
    others = [other for item in _siblings(path) if (other := _opened(item, first, limits))]
    return _ordered([first, *_of_recording(first, others)], str(path))


def _siblings(path: Path) -> list[Path]:
    return [item for item in _stored(path) if item != path]


def _stored(path: Path) -> list[Path]:
    """The files beside `path` that have its name but for the number; `path` itself is one."""
    match = _SEGMENT.fullmatch(path.name)
    if match is None:
        return [path] if path.exists() else []
    while True:
        mine = [
            item
            for item in sorted(path.parent.iterdir())
            if (other := _SEGMENT.fullmatch(item.name)) and other["stem"] == match["stem"]
        ]
        try:
            return [item for item in mine if _is_stored(item, mine)]
        except FileNotFoundError:  # it got its final name since the folder was listed
            continue


def _is_stored(path: Path, listed: Sequence[Path]) -> bool:
    """Not the unfinished name of a file that is finished beside it, nor one just begun."""
    if path.suffix != ".part":
        return True
    return path.with_suffix("") not in listed and path.stat().st_size > 0


def grown_segments(files: Sequence[McapFile], limits: Limits) -> list[McapFile] | None:
    """The files of a session that is being recorded as they are now; None if nothing has changed.

    Files that are as they were stay open and are the same objects; the others are closed.
    """
    known = {file.path: file for file in files}
    first, opened = files[0].path, list[McapFile]()
    there = _stored(first)
    if len(there) < len(known):  # a listing can miss a file that gets its final name meanwhile
        there = _stored(first)
    if not there:
        raise SessionError(f"{first} and all other files of the recording are gone")
    try:
        changed = [path for path in there if _size(known.get(path)) != path.stat().st_size]
        if not changed and all(path in there for path in known):
            return None
        opened += (other for path in changed if (other := _opened(path, files[0], limits)))
    except FileNotFoundError:  # one got its final name meanwhile
        for file in opened:
            file.close()
        return grown_segments(files, limits)
    recording = _identity(files[0])[0]
    same = [file for path, file in known.items() if path in there and path not in changed]
    mine = [file for file in opened if _identity(file)[0] == recording]
    for file in {*files, *opened} - {*same, *mine}:
        file.close()
    return _ordered([*same, *mine], str(first))


def _size(file: McapFile | None) -> int:
    return -1 if file is None else file.source.size


def _opened(path: Path, first: McapFile, limits: Limits) -> McapFile | None:
    try:
        return McapFile(path, limits)
    except SessionError as error:
        first.note(f"{path} beside {first.path} cannot be read: {error}")
        return None


def _of_recording(first: McapFile, others: list[McapFile]) -> list[McapFile]:
    wanted = _identity(first)[0]
    kept = []
    for other in others:
        if _identity(other)[0] == wanted:
            kept.append(other)
        else:
            other.close()
    return kept


def _identity(file: McapFile) -> tuple[str | None, int]:
    for name, values in file.metadata:
        if name == RECORDING:
            index = values.get("index", "1")
            return values.get("id"), int(index) if index.isdigit() else 1
    return None, 1


def _ordered(files: list[McapFile], where: str) -> list[McapFile]:
    named = sorted(
        ((*_identity(file), file) for file in files), key=lambda row: (row[1], row[2].path)
    )
    fault = _mixture([(identity, index) for identity, index, _ in named])
    if fault:
        names = ", ".join(file.path.name for file in files)
        for file in files:
            file.close()
        raise SessionError(f"{where} holds {fault} ({names}); name the file of one")
    ordered = [file for _, _, file in named]
    present = {index for _, index, _ in named}
    missing = sorted(set(range(1, max(present, default=0) + 1)) - present)
    if missing:
        ordered[0].note(
            f"{where}: file {', '.join(map(str, missing))} of the recording is not there"
        )
    return ordered


def _mixture(named: list[tuple[str | None, int]]) -> str:
    if len({identity for identity, _ in named}) > 1:
        return "files of different recordings"
    repeated = len(set(named)) < len(named)
    return "a recording more than once" if repeated and named[0][0] is not None else ""


def is_live(ring_path: str) -> bool:
    """True while a process of the recording with these rings lives, on this machine."""
    if not _RINGS.fullmatch(ring_path):
        return False
    try:
        import fcntl

        with Path(ring_path, "lock").open("rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except OSError:
                return True
    except (ImportError, OSError):
        return False
    return False
