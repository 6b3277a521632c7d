"""Decoders and importers to be fuzzed: the first byte of an input chooses what reads the rest."""

import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.errors import SeamlogError
from seamlog.limits import LIMITS
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.columns import ChannelDecoder, Wish
from seamlog.mcap.definitions import cdr, ros1
from seamlog.mcap.packing import payload_records
from seamlog.mcap.protobuf import ProtobufGrammar
from seamlog.mcap.records import Malformed, Schema
from seamlog.mcap.rows import Chunk, iter_batches
from seamlog.recorder.importers.csv import CsvImporter
from seamlog.recorder.importers.mat import MatImporter
from seamlog.recorder.importers.parquet import ParquetImporter
from seamlog.recorder.importers.ros_bags import Ros1Importer, Ros2Importer
from seamlog.recorder.importers.tdms import TdmsImporter
from seamlog.recorder.importers.ulog import ULogImporter
from tests.core.protobuf_schemas import everything, joint_states

TEXT = b"int8 a\nstring[] b\nfloat64[2] c\nInner[] d\n===\nMSG: p/Inner\nstring e\nuint16[<=3] f\n"
SCHEMA = Schema(1, "p/msg/Outer", "ros2msg", TEXT)
GRAMMARS: tuple[Any, ...] = (
    cdr(SCHEMA),
    ros1(SCHEMA),
    ProtobufGrammar(Schema(1, "test.JointStates", "protobuf", joint_states().SerializeToString())),
    ProtobufGrammar(Schema(1, "test.All", "protobuf", everything().SerializeToString())),
)


def decode(grammar: Any, data: bytes, varied: bool) -> None:
    """Read `data`, cut into payloads, by shapes or one after the other."""
    size = 1 + data[0] % 40 if data else 1
    payloads = [data[start : start + size] for start in range(1, len(data), size)][:50]
    times = np.arange(len(payloads), dtype=np.int64)
    records, _ = payload_records(payloads, times, slice(0, len(payloads)), 1, 0)
    chunk = Chunk(memoryview(records), lambda: None)
    decoder = ChannelDecoder(grammar, [Wish(name, name) for name in grammar.forms], LIMITS)
    for batch in iter_batches([chunk], 1):
        if varied and batch.count:
            grammar.decode(batch, list(grammar.forms))
        else:
            decoder.add(batch)


def define(kind: str, data: bytes) -> None:
    """Read `data` as a message definition."""
    schema = Schema(1, "test.All" if kind == "protobuf" else "p/msg/Outer", kind, data)
    ProtobufGrammar(schema) if kind == "protobuf" else cdr(schema)


def bag(importer: Any, path: Path) -> None:
    """Import a bag into a session that nobody looks at."""
    with BatchWriter(path.with_name("out.mcap"), force=True) as writer:
        importer().write(path, writer)


def readers(path: Path) -> list[Callable[[bytes], Any]]:
    """Everything that reads bytes of others."""

    def table(importer: Any) -> Callable[[bytes], Any]:
        def read(data: bytes) -> None:
            path.write_bytes(data)
            importer().load(path)

        return read

    def messages(importer: Any, suffix: str) -> Callable[[bytes], Any]:
        def read(data: bytes) -> None:
            path.with_suffix(suffix).write_bytes(data)
            bag(importer, path.with_suffix(suffix))

        return read

    return [
        *(lambda data, g=g, v=v: decode(g, data, v) for g in GRAMMARS for v in (False, True)),
        *(lambda data, k=k: define(k, data) for k in ("ros2msg", "ros2idl", "protobuf")),
        *(table(item) for item in (CsvImporter, MatImporter, ParquetImporter, TdmsImporter)),
        messages(Ros1Importer, ".bag"),
        messages(Ros2Importer, ".db3"),
        table(ULogImporter),
    ]


def attempt(read: Callable[[bytes], Any], data: bytes) -> None:
    """Anything but the family's errors escapes; `Malformed` becomes one of them in `McapFile`."""
    with suppress(SeamlogError, Malformed):
        read(data)


def seeds(valid: dict[int, bytes]) -> list[bytes]:
    """Inputs that begin with what reads them."""
    return [struct.pack("B", number) + data for number, data in valid.items()]
