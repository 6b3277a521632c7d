"""`seamlog attach`: photos, procedures and calibrations into a session that is already there."""

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from seamlog.command import command, force_option, session_argument
from seamlog.errors import OutputExists, SessionError, UsageError
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from seamlog.mcap.attachments import Attachment
    from seamlog.session import Session

KINDS = ("photo", "wps", "calibration")
_PICTURES = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp"}
_MEDIA_TYPES = {
    ".json": "application/json",
    ".toml": "application/toml",
    ".pdf": "application/pdf",
    ".txt": "text/plain",
    ".md": "text/markdown",
    ".csv": "text/csv",
    ".yaml": "application/yaml",
    ".yml": "application/yaml",
}
_UNSAFE = re.compile(r"[^\w. +()-]")


@command()
@session_argument
@click.argument(
    "files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE..."
)
@click.option(
    "--as",
    "kind",
    type=click.Choice(KINDS),
    help="What the files are; else pictures are photos, *.calibration.json calibrations, "
    "anything else a welding procedure.",
)
@force_option
def attach(session: Path, files: tuple[Path, ...], kind: str | None, force: bool) -> Outcome:
    """Put FILEs into SESSION: photos, welding procedures, calibrations.

    The session is copied without encoding anything anew, synced, and only then takes the place
    of the old one.
    """
    from seamlog.mcap.file import McapFile
    from seamlog.session import Session

    found = [read_attachment_file(path, kind) for path in files]
    names = [item.name for item in found]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"two files would both be {name!r}; rename one")
    if session.is_dir():
        raise UsageError(f"{session} is a folder; name the file of the session to attach to")
    target = session.resolve()
    opened = McapFile(target)
    with Session([opened], opened.limits) as original:
        _check(original, names, force)
        rewrite(original, found)
    lines = [f"{item.name}  {item.media_type}  {len(item.data)} bytes" for item in found]
    document = {"session": str(session), "attached": names}
    return Outcome("seamlog.attach", "\n".join(lines), document)


def read_attachment_file(path: Path, kind: str | None) -> "Attachment":
    """Read a file as an attachment of `kind` (None: by its name); pictures are checked."""
    from seamlog.mcap.attachments import Attachment
    from seamlog.pictures import check_picture

    size = path.stat().st_size
    if not size:
        raise UsageError(f"{path} is empty; there is nothing to attach")
    kind = kind or _kind(path)
    data = path.read_bytes()
    media_type = _MEDIA_TYPES.get(path.suffix.lower(), "application/octet-stream")
    if kind == "photo" or path.suffix.lower() in _PICTURES:
        media_type = check_picture(data, str(path)).media_type
    if kind == "calibration" and path.suffix.lower() == ".json":
        from seamlog.calibration import parse_any_calibration

        parse_any_calibration(data, str(path))
    name = f"{kind}/{_sanitised(path.name)}"
    return Attachment(name, media_type, time.time_ns(), data, path.stat().st_mtime_ns)


def _kind(path: Path) -> str:
    if path.suffix.lower() in _PICTURES:
        return "photo"
    return "calibration" if path.name.lower().endswith("calibration.json") else "wps"


def _sanitised(name: str) -> str:
    plain = _UNSAFE.sub("_", name).lstrip(".")
    return plain[-120:] or "file"


def _check(session: "Session", names: list[str], force: bool) -> None:
    taken = [name for name in names if name in session.attachments]
    if taken and not force:
        raise OutputExists(
            f"{session.path} holds {', '.join(taken)} already; rename the file, or --force to "
            "replace it"
        )
    if problems := session.files[0].problems:
        raise SessionError(
            f"{session.path} is not whole and stays as it is: {problems[0]}; attach to a "
            "finished session"
        )


def rewrite(session: "Session", attachments: list["Attachment"]) -> None:
    """Replace the session's file by one that also holds `attachments`; same names are replaced.

    `SessionError` if a chunk turns out to be damaged; the file then stays as it was.
    """
    from seamlog.mcap.batch import BatchWriter

    names = {item.name for item in attachments}
    mode = session.path.stat().st_mode
    with BatchWriter(session.path, force=True) as writer:
        writer.copy_session(session, leave_out=names, same_recording=True)
        if problems := session.files[0].problems:
            raise SessionError(f"{session.path} is damaged and stays as it was: {problems[0]}")
        for item in attachments:
            writer.attach(
                item.name, item.data, item.media_type, item.log_time_ns, item.create_time_ns
            )
    session.path.chmod(mode)
