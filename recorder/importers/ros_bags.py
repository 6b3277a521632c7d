"""ROS bags: every topic is taken over as it is, with its message definition."""

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

from seamlog.errors import HardwareError, ImportFailed, SessionError
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.file import McapFile
from seamlog.mcap.records import Schema
from seamlog.mcap.rows import iter_batches
from seamlog.mcap.streams import MessageStream

from .content import Report
from .ros1_walk import Walk
from .ros_definitions import completed, own_packages, schema_of
from .ros_files import counts_of, files_of, is_compressed_by_message, plain

_DAMAGED = (struct.error, ValueError, IndexError, KeyError, AssertionError)
"""What rosbags raises over messages that do not fit their definition, besides its own errors."""
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"


class Ros2Importer:
    """Reads ROS 2 bags: a folder with `metadata.yaml`, or one `.db3` or `.mcap` file of it.

    Parts that are missing are noted with what they held; the rest is imported.
    """

    def write(self, path: Path, writer: BatchWriter) -> Report:
        """Copy all messages into `writer`; what was lost or had to be decided."""
        report = Report()
        files = files_of(path, report)
        counts = counts_of(path if path.is_dir() else path.parent)
        streams = _Streams(writer, report, is_compressed_by_message(path))
        read = 0
        for file in files:
            with plain(file, report) as unpacked:
                copy = streams.copy_mcap if unpacked.suffix == ".mcap" else streams.copy_sqlite
                count = copy(unpacked, file)
            if count is None:
                continue
            read += 1
            lost = counts.get(file.name, 0) - count
            if lost > 0:
                report.losses.append(
                    f"{file.name}: metadata.yaml counts {counts[file.name]} messages, {lost} more "
                    "than were found"
                )
        streams.finish()
        if not read:
            why = "; ".join(report.losses)
            raise ImportFailed(f"{path}: nothing of this bag can be read; {why}")
        return report


class Ros1Importer:
    """Reads ROS 1 bags; messages become CDR with ROS 2 definitions.

    A bag without an index, or with a lost end, is walked record by record.
    """

    def write(self, path: Path, writer: BatchWriter) -> Report:
        """Copy all messages into `writer`; what was lost or had to be decided."""
        _rosbags("rosbag1", path)
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

        report = Report()
        store = get_typestore(Stores.EMPTY)
        # rosbags drops `seq`, which the header of ROS 1 has, while it converts
        store.register(get_types_from_msg(_HEADER, "std_msgs/msg/Header"))
        streams, bad, count = _Streams(writer, report), Counter[str](), 0
        for connection, time, raw in _messages_of_ros1(path, report):
            name = connection.msgtype
            try:
                if name not in store.types:
                    types = get_types_from_msg(connection.msgdef.data, name)
                    store.register({k: v for k, v in types.items() if k not in store.types})
                payload = bytes(store.ros1_to_cdr(raw, name))
            except (*_DAMAGED, SerdeError, TypesysError):
                bad[connection.topic] += 1
                continue
            stream = streams.of(connection, lambda name=name: schema_of(name, store))
            if stream is not None:
                stream.put(time, payload)
                count += 1
        report.losses += [
            f"{topic}: {number} messages do not fit their definition and were left out"
            for topic, number in bad.items()
        ]
        if not count and report.losses:
            raise ImportFailed(f"{path}: no message can be read; {'; '.join(report.losses)}")
        streams.finish()
        return report


def _messages_of_ros1(path: Path, report: Report) -> Iterator[tuple[Any, int, bytes]]:
    from rosbags.rosbag1 import Reader, ReaderError

    reader = Reader(path)
    try:
        reader.open()
    except (ReaderError, OSError, *_DAMAGED) as error:
        yield from _walked(path, report, error)
        return
    try:
        yield from reader.messages()
    except (ReaderError, *_DAMAGED, OSError, RuntimeError) as error:
        report.losses.append(f"{path.name}: reading stopped at a fault: {error}")
    finally:
        reader.close()


def _walked(path: Path, report: Report, reason: Exception) -> Iterator[tuple[Any, int, bytes]]:
    walk = Walk(_mapped(path))
    try:
        yield from walk.messages()
    except ImportFailed as error:
        raise ImportFailed(f"{path} cannot be read as a ROS 1 bag: {error}") from error
    report.notes.append(f"the bag has no usable index ({reason}); its records were walked")
    if walk.stopped:
        report.losses.append(f"{path.name}: {walk.stopped}; what follows could not be read")


def _mapped(path: Path) -> memoryview:
    if not path.stat().st_size:
        return memoryview(b"")
    with path.open("rb") as file:
        return memoryview(mmap(file.fileno(), 0, access=ACCESS_READ))


class _Streams:
    """Message streams by connection, and what had to be left out."""

    def __init__(self, writer: BatchWriter, report: Report, by_message: bool = False) -> None:
        self._writer, self._report, self._by_message = writer, report, by_message
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

    @property
    def _unpack(self) -> Callable[[Any], bytes]:
        import zstandard

        return zstandard.ZstdDecompressor().decompress if self._by_message else bytes

    def copy_sqlite(self, path: Path, origin: Path) -> int | None:
        """Copy the messages of one SQLite file; how many it has."""
        rosbag2 = _rosbags("rosbag2", origin)
        unpack, count = self._unpack, 0
        try:
            with rosbag2.Reader(path) as reader:
                for connection, time, raw in reader.messages():
                    stream = self.of(connection, lambda c=connection: self._schema(c))
                    count += 1
                    if stream is not None:
                        stream.put(time, unpack(raw))
        except Exception as error:
            if not any(self._found.values()):
                raise ImportFailed(
                    f"{origin} cannot be read as a ROS 2 bag: {error}; a cut or damaged database "
                    f"may be saved by: sqlite3 {origin.name} .recover | sqlite3 whole.db3"
                ) from error
            self._report.losses.append(f"{origin.name}: reading stopped at a fault: {error}")
        return count

    def copy_mcap(self, path: Path, origin: Path) -> int | None:
        """Copy the messages of one MCAP file; how many it has, None if it cannot be read."""
        try:
            file = McapFile(path)
        except SessionError as error:
            self._report.losses.append(str(error))
            return None
        try:
            schemas = {row.id: self._completed(file, row) for row in file.index.channels.values()}
            changed = [row for row in schemas if schemas[row] is not _own(file, row)]
            if changed or self._by_message:
                count = self._copy_messages(file, schemas)
            else:
                self._writer.copy_file(file)
                count = sum(file.index.statistics.channel_counts.values())
            self._report.losses += file.problems
        finally:
            file.close()
        return count

    def _completed(self, file: McapFile, row: Any) -> Schema | None:
        schema, added = completed(_own(file, row.id), row.message_encoding)
        if added:
            self._note_added(row.topic, added)
        return schema

    def _copy_messages(self, file: McapFile, schemas: dict[int, Schema | None]) -> int:
        unpack, count = self._unpack, 0
        for row in file.index.channels.values():
            schema = schemas[row.id]
            stream = self._writer.stream(row.topic, schema, row.message_encoding, row.metadata)
            for batch in iter_batches(file.iter_chunks(file.entries(row.id)), row.id):
                for time, payload in batch.payloads():
                    stream.put(time, unpack(payload))
                    count += 1
        return count

    def _schema(self, connection: Any) -> Schema | None:
        from rosbags.interfaces import MessageDefinitionFormat as Format

        definition = connection.msgdef
        if definition.format != Format.NONE and definition.data:
            encoding = "ros2msg" if definition.format == Format.MSG else "ros2idl"
            return Schema(0, connection.msgtype, encoding, definition.data.encode())
        store = own_packages()
        if connection.msgtype not in store.types:
            return None
        self._note_added(connection.topic, f"the definition of {connection.msgtype}")
        return schema_of(connection.msgtype, store)

    def _note_added(self, topic: str, added: str) -> None:
        self._report.notes.append(
            f"{topic}: the bag lacks {added}; that of ROS 2's own packages, as rosbags knows it, "
            "was taken"
        )

    def finish(self) -> None:
        """Note what was left out."""
        for (topic, name), count in self._lost.items():
            self._report.losses.append(
                f"{topic}: {count} messages were left out: the bag has no definition of {name}"
            )


def _rosbags(module: str, path: Path) -> Any:
    from importlib import import_module

    try:
        return import_module(f"rosbags.{module}")
    except ImportError as error:
        raise HardwareError(
            f"{path}: ROS bags are read by rosbags: pip install 'seamlog[import]'"
        ) from error


def _own(file: McapFile, channel_id: int) -> Schema | None:
    return file.index.schemas.get(file.index.channels[channel_id].schema_id)
