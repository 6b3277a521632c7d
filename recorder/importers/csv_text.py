"""The text of a table file: encoding, line ends, cells that go over several lines."""

import codecs
from pathlib import Path

from seamlog.errors import ImportFailed

_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_LONGEST_CELL = 50
"""Lines that a cell in quotes may have; a quote that stays open longer is a stray one."""
_OTHER_KINDS = {
    b"PK\x03\x04": "a ZIP file, such as an Excel workbook; save its sheet as CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook; save its sheet as CSV",
    b"<": "a document of markup (HTML, XML); save its table as CSV",
    b"{": "a JSON document; write its rows as CSV or Parquet",
    b"[{": "a JSON document; write its rows as CSV or Parquet",
}


def decode(path: Path) -> tuple[str, str, list[str]]:
    """Text, encoding and notes of a file; `ImportFailed` if it is no text."""
    data = path.read_bytes()
    for magic, what in _OTHER_KINDS.items():
        if data.startswith(magic):
            raise ImportFailed(f"{path} is {what}")
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            return _decoded(path, data, encoding), encoding, []
    notes = []
    whole = data.rstrip(b"\0")
    if data[1:2] != b"\0" and len(data) - len(whole) > 1:
        notes.append(f"{len(data) - len(whole)} empty bytes behind the text: it was cut off there")
        data = whole
    if b"\0" in data[:4096]:
        return _decoded(path, data, _without_mark(path, data)), "utf-16", notes
    try:
        return data.decode("utf-8"), "utf-8", notes
    except UnicodeDecodeError:
        notes.append("the text is not UTF-8 and was read as Windows-1252")
        return data.decode("cp1252", errors="replace"), "cp1252", notes


def _without_mark(path: Path, data: bytes) -> str:
    """UTF-16 without a byte order mark: every other byte of western text is 0."""
    head = data[:4096]
    for place, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if head[place::2].count(0) > len(head) * 0.45 and not head[1 - place :: 2].count(0):
            return encoding
    raise ImportFailed(f"{path} holds binary data, not a text table")


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise ImportFailed(f"{path} begins as {encoding} and is not: {error}") from error


def one_line_cells(text: str) -> str:
    """Text whose lines are rows: line ends of any kind, none of them within a cell."""
    if "\n" not in text:
        text = text.replace("\r", "\n")
    text = text.replace("\r\n", "\n")
    if '"' not in text:
        return text
    found: list[str] = []
    held: list[str] = []
    is_open = False
    for line in text.split("\n"):
        held.append(line)
        is_open ^= line.count('"') % 2 == 1
        if not is_open:
            found.append(" ".join(held))
            held = []
        elif len(held) > _LONGEST_CELL:
            found, held, is_open = [*found, *held], [], False
    return "\n".join([*found, *held])
