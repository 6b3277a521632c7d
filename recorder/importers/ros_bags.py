"""ROS bags: every topic is taken over as it is, with its message definition."""

import re
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from seamlog.errors import HardwareError, ImportFailed, SessionError
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.file import McapFile
from seamlog.mcap.records import Schema
from seamlog.mcap.streams import MessageStream

from .content import Report

_PATHS = re.compile(r"relative_file_paths:\s*\n((?:\s+- .*\n?)+)")
_COUNTS = re.compile(r"- path: (?P<path>.*)\n(?:.*\n){1,6}?\s+message_count: (?P<count>\d+)")
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_BAG_FILES = (".mcap", ".db3", ".zstd")


class Ros2Importer:
    """Reads ROS 2 bags: a folder with `metadata.yaml`, or one `.db3` or `.mcap` file of it.

    Parts that are missing are noted with what they held; the rest is imported.
    """

    def write(self, path: Path, writer: BatchWriter) -> Report:
        """Copy all messages into `writer`; what was lost or had to be decided."""
        report = Report()
        files = _files(path, report)
        message_mode = _is_compressed_by_message(path)
        streams = _Streams(writer, report)
        read = 0
        for file in files:
            with _plain(file) as plain:
                if plain.suffix == ".mcap":
                    read += _copy_mcap(plain, writer, report)
                else:
                    streams.copy_sqlite(plain, file, message_mode)
                    read += 1
        streams.finish()
        if not read:
            why = "; ".join(report.losses)
            raise ImportFailed(f"{path}: nothing of this bag can be read; {why}")
        return report


class Ros1Importer:
    """Reads ROS 1 bags; messages become CDR with ROS 2 definitions."""

    def write(self, path: Path, writer: BatchWriter) -> Report:
        """Copy all messages into `writer`; what was lost or had to be decided."""
        rosbag1 = _rosbags("rosbag1", path)
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        report = Report()
        store = get_typestore(Stores.EMPTY)
        # rosbags drops `seq`, which the header of ROS 1 has, while it converts
        store.register(get_types_from_msg(_HEADER, "std_msgs/msg/Header"))
        streams = _Streams(writer, report)
        try:
            with rosbag1.Reader(path) as reader:
                for connection in reader.connections:
                    types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
                    store.register({k: v for k, v in types.items() if k not in store.types})
                for connection, time, raw in reader.messages():
                    name = connection.msgtype
                    payload = bytes(store.ros1_to_cdr(raw, name))
                    stream = streams.of(connection, lambda name=name: _schema(name, store))
                    if stream is not None:
                        stream.put(time, payload)
        except (ImportFailed, OSError):
            raise
        except Exception as error:
            raise ImportFailed(f"{path} cannot be read as a ROS 1 bag: {error}") from error
        streams.finish()
        return report


class _Streams:
    """Message streams by connection, and what had to be left out."""

    def __init__(self, writer: BatchWriter, report: Report) -> None:
        self._writer, self._report = writer, report
        self._found: dict[tuple[str, str], MessageStream | None] = {}
        self._lost: Counter[tuple[str, str]] = Counter()

    def of(self, connection: Any, schema: Any) -> MessageStream | None:
        """The stream of a connection; None where nobody knows its messages."""
        key = (connection.topic, connection.msgtype)
        if key not in self._found:
            made = schema()
            self._found[key] = self._writer.stream(connection.topic, made) if made else None
        if self._found[key] is None:
            self._lost[key] += 1
        return self._found[key]

    def copy_sqlite(self, path: Path, origin: Path, message_mode: bool) -> None:
        """Copy the messages of one SQLite file."""
        rosbag2 = _rosbags("rosbag2", origin)
        import zstandard

        unpack = zstandard.ZstdDecompressor().decompress if message_mode else bytes
        try:
            with rosbag2.Reader(path) as reader:
                for connection, time, raw in reader.messages():
                    stream = self.of(connection, lambda c=connection: self._schema(c))
                    if stream is not None:
                        stream.put(time, unpack(raw))
        except Exception as error:
            if not any(self._found.values()):
                raise ImportFailed(f"{origin} cannot be read as a ROS 2 bag: {error}") from error
            self._report.losses.append(f"{origin.name}: reading stopped at a fault: {error}")

    def _schema(self, connection: Any) -> Schema | None:
        from rosbags.interfaces import MessageDefinitionFormat as Format
        from rosbags.typesys import Stores, get_typestore

        definition = connection.msgdef
        if definition.format != Format.NONE and definition.data:
            encoding = "ros2msg" if definition.format == Format.MSG else "ros2idl"
            return Schema(0, connection.msgtype, encoding, definition.data.encode())
        store = get_typestore(Stores.LATEST)
        if connection.msgtype not in store.types:
            return None
        self._report.notes.append(
            f"{connection.topic}: the bag has no definition of {connection.msgtype}; the one of "
            "ROS 2's own packages, as rosbags knows it, was taken"
        )
        return _schema(connection.msgtype, store)

    def finish(self) -> None:
        """Note what was left out."""
        for (topic, name), count in self._lost.items():
            self._report.losses.append(
                f"{topic}: {count} messages were left out: the bag has no definition of {name}"
            )


def _schema(name: str, store: Any) -> Schema:
    text, _ = store.generate_msgdef(name, ros_version=2)
    return Schema(0, name, "ros2msg", text.encode())


def _rosbags(module: str, path: Path) -> Any:
    from importlib import import_module

    try:
        return import_module(f"rosbags.{module}")
    except ImportError as error:
        raise HardwareError(
            f"{path}: ROS bags are read by rosbags: pip install 'seamlog[import]'"
        ) from error


def _files(path: Path, report: Report) -> list[Path]:
    """Files of the bag in order; missing ones are losses."""
    if path.is_file():
        report.notes += _beside(path)
        return [path]
    listing = path / "metadata.yaml"
    if not listing.is_file():
        found = sorted(item for item in path.iterdir() if item.suffix in _BAG_FILES)
        if not found:
            raise ImportFailed(f"{path} is no ROS bag: no metadata.yaml, no .mcap or .db3 file")
        report.notes.append(
            f"{path.name} has no metadata.yaml: nothing tells whether parts are missing"
        )
        return found
    text = listing.read_text(encoding="utf-8", errors="replace")
    match = _PATHS.search(text)
    if match is None:
        raise ImportFailed(f"{listing} lists no files; it is no metadata of a ROS 2 bag")
    names = [_file_name(line) for line in match[1].splitlines() if line.strip()]
    counts = {_file_name(row["path"]): row["count"] for row in _COUNTS.finditer(text)}
    report.losses += [
        f"{name} is missing" + (f": {counts[name]} messages" if name in counts else "")
        for name in names
        if not (path / name).is_file()
    ]
    return [path / name for name in names if (path / name).is_file()]


def _beside(path: Path) -> list[str]:
    """A note if a bag's metadata names more files than the one that was asked for."""
    listing = path.parent / "metadata.yaml"
    if not listing.is_file():
        return []
    match = _PATHS.search(listing.read_text(encoding="utf-8", errors="replace"))
    names = [_file_name(line) for line in match[1].splitlines() if line.strip()] if match else []
    if path.name not in names or len(names) < 2:
        return []
    return [f"{path.name} is one of {len(names)} files of a bag; name its folder to import all"]


def _file_name(line: str) -> str:
    return Path(line.strip().removeprefix("- ").strip("\"' ")).name


def _is_compressed_by_message(path: Path) -> bool:
    folder = path if path.is_dir() else path.parent
    with suppress(OSError):
        text = (folder / "metadata.yaml").read_text(encoding="utf-8", errors="replace")
        return bool(re.search(r"compression_mode:\s*[\"']?message", text, re.IGNORECASE))
    return False


@contextmanager
def _plain(file: Path) -> Iterator[Path]:
    """The file itself, or what is packed in a `.zstd` file."""
    if file.suffix != ".zstd":
        yield file
        return
    import zstandard

    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / file.stem
        try:
            with file.open("rb") as packed, plain.open("wb") as unpacked:
                zstandard.ZstdDecompressor().copy_stream(packed, unpacked)
        except zstandard.ZstdError as error:
            raise ImportFailed(f"{file} cannot be unpacked: {error}") from error
        yield plain


def _copy_mcap(path: Path, writer: BatchWriter, report: Report) -> bool:
    try:
        file = McapFile(path)
    except SessionError as error:
        report.losses.append(str(error))
        return False
    try:
        writer.copy_file(file)
        report.losses += file.problems
    finally:
        file.close()
    return True
