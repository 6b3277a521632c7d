"""Files made to take a reader down: bombs, indexes that lie, pictures that declare too much."""

import struct
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from zlib_ng.zlib_ng import crc32

from seamlog import messages
from seamlog.channels import CHANNELS
from seamlog.mcap import records
from seamlog.mcap.writer import FileWriter
from tests.core.scenarios import write_live

MAKERS: dict[str, Callable[[Path], None]] = {}
ENCODER = CHANNELS["/table/encoder"]


def hostile(make: Callable[[Path], None]) -> Callable[[Path], None]:
    """Register under the function's name."""
    MAKERS[make.__name__] = make
    return make


def front() -> bytes:
    schema = records.Schema(1, ENCODER.schema, "ros2msg", messages.definition(ENCODER).encode())
    channel = records.ChannelRecord(1, 1, ENCODER.topic, "cdr", {})
    return records.schema(schema) + records.channel(channel)


def message(time: int = 1) -> bytes:
    payload = messages.encode(ENCODER, (time, 0.0, 0.0))
    head = struct.pack("<HIQQ", 1, 0, time, time)
    return records.record(records.MESSAGE, head, payload)


def chunk(body: bytes, size: int, crc: int, compression: str) -> bytes:
    return records.chunk_head(1, 1, size, crc, compression, len(body)) + body


def file_of(*chunks: bytes) -> bytes:
    return records.MAGIC + records.header("ros2", "hostile") + b"".join(chunks)


@hostile
def bomb_that_says_so(path: Path) -> None:
    """8 GB of zeros in a chunk that declares them."""
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=8 << 30)
    block = bytes(64 << 20)
    body = b"".join(compressor.compress(block) for _ in range(128)) + compressor.flush()
    path.write_bytes(file_of(chunk(body, 8 << 30, 1, "zstd")))


@hostile
def bomb_that_lies_zstd(path: Path) -> None:
    body = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(400 << 20))
    path.write_bytes(file_of(chunk(body, 1000, 1, "zstd")))


@hostile
def bomb_that_lies_lz4(path: Path) -> None:
    body = lz4.frame.compress(bytes(300 << 20), store_size=False)
    path.write_bytes(file_of(chunk(body, 1000, 1, "lz4")))


@hostile
def many_bombs(path: Path) -> None:
    """32 chunks of 250 MB of true messages each, all within the limit of one chunk."""
    one = message()
    data = front() + one * (250_000_000 // len(one))
    body = zstandard.ZstdCompressor(level=1).compress(data)
    path.write_bytes(file_of(*[chunk(body, len(data), crc32(data), "zstd")] * 32))


@hostile
def statistics_of_everything(path: Path) -> None:
    write_live(path)
    rewrite_summary(path, lambda count: struct.pack("<Q", count), (1 << 60) + 7)


@hostile
def index_of_one_chunk_many_times(path: Path) -> None:
    write_live(path)
    data = path.read_bytes()
    end = len(data) - len(records.MAGIC)
    (start,) = struct.unpack_from("<Q", data, end - 20)
    at = start
    while data[at] != records.CHUNK_INDEX:
        at += records.RECORD_HEAD.unpack_from(data, at)[1] + 9
    length = records.RECORD_HEAD.unpack_from(data, at)[1] + 9
    summary = data[start : end - records.FOOTER_BYTES] + data[at : at + length] * 200_000
    summary += records.footer(start, 0)
    path.write_bytes(data[:start] + summary + struct.pack("<I", crc32(summary)) + records.MAGIC)


@hostile
def strings_of_four_gigabytes(path: Path) -> None:
    body = struct.pack("<HHI", 1, 0, 0xFFFFFFF0) + b"/topic"
    whole = records.record(records.CHANNEL, body)
    path.write_bytes(file_of(chunk(whole, len(whole), crc32(whole), "")))


@hostile
def lengths_of_everything(path: Path) -> None:
    path.write_bytes(file_of(records.RECORD_HEAD.pack(records.CHUNK, (1 << 63) + 5) + bytes(400)))


@hostile
def sequence_of_four_billion(path: Path) -> None:
    """A `float64[]` that declares 2**32 - 1 values."""
    row = CHANNELS["/seam/points"]
    with path.open("xb", buffering=0) as file:
        writer = FileWriter(file, "hostile")
        schema = writer.add_schema(row.schema, messages.definition(row))
        writer.add_channel(row.topic, schema, {})
        payload = messages.CDR_HEADER + struct.pack("<qI4xd", 1, 0xFFFFFFFF, 0.0)
        head = struct.pack("<HIQQ", 1, 0, 1, 1)
        data = records.record(records.MESSAGE, head, payload)
        writer.write_chunk(1, data, np.array([1], np.uint64), np.array([0], np.uint64))
        writer.finish()


@hostile
def definition_that_holds_itself(path: Path) -> None:
    text = "a/B b\n" + "=" * 80 + "\nMSG: a/B\na/B again\nfloat64 x\n"
    schema = records.Schema(1, "a/B", "ros2msg", text.encode())
    channel = records.ChannelRecord(1, 1, "/a", "cdr", {})
    data = records.schema(schema) + records.channel(channel) + message()
    path.write_bytes(file_of(chunk(data, len(data), crc32(data), "")))


@hostile
def attachment_of_everything(path: Path) -> None:
    head = struct.pack("<QQ", 0, 0) + records.pack_string("a") + records.pack_string("b")
    body = head + struct.pack("<Q", 1 << 62) + bytes(40)
    path.write_bytes(file_of(records.record(records.ATTACHMENT, body)) + bytes(0))


@hostile
def a_false_chunk_at_every_byte(path: Path) -> None:
    """Heads of chunks that all claim the rest of the file: resynchronising must not try all."""
    size, heads = 4 << 20, []
    at = 64
    while at < size - 256:
        rest = size - at - 9
        head = records.chunk_head(1, 1, rest - 40, 7, "", rest - 40)
        heads.append(head)
        at += len(head)
    data = file_of(b"\x06\xff\xff\xff") + b"".join(heads)
    path.write_bytes(data.ljust(size, b"\x01"))


@hostile
def picture_of_a_billion_pixels(path: Path) -> None:
    """A JPEG of 200 bytes that declares 30000 x 30000 pixels."""
    import cv2

    data = bytearray(cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0")
    struct.pack_into(">HH", data, at + 5, 30_000, 30_000)
    row = CHANNELS["/camera/image"]
    with path.open("xb", buffering=0) as file:
        writer = FileWriter(file, "hostile")
        schema = writer.add_schema(row.schema, messages.definition(row))
        writer.add_channel(row.topic, schema, {})
        payload = messages.encode_image(1, "camera", "jpeg", bytes(data))
        head = struct.pack("<HIQQ", 1, 0, 1, 1)
        whole = records.record(records.MESSAGE, head, payload)
        writer.write_chunk(1, whole, np.array([1], np.uint64), np.array([0], np.uint64), "")
        writer.add_attachment("photo/a.jpg", bytes(data), "image/jpeg", 1)
        writer.finish()


def rewrite_summary(path: Path, pack: Callable[[int], bytes], value: int) -> None:
    """Replace the count of messages in the statistics and sign the summary."""
    data = path.read_bytes()
    end = len(data) - len(records.MAGIC)
    (start,) = struct.unpack_from("<Q", data, end - 20)
    summary = bytearray(data[start : end - 4])
    at = 0
    while summary[at] != records.STATISTICS:
        at += 9 + records.RECORD_HEAD.unpack_from(summary, at)[1]
    summary[at + 9 : at + 17] = pack(value)
    path.write_bytes(data[:start] + summary + struct.pack("<I", crc32(summary)) + records.MAGIC)
