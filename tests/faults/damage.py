"""Files with known content and ways to damage them, each drawn from a seed."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from seamlog import messages
from seamlog.channels import CHANNELS
from seamlog.mcap.packing import payload_records
from seamlog.mcap.writer import FileWriter
from tests.core.scenarios import START_NS, Expected, write_foreign

ENCODER, CAMERA = CHANNELS["/table/encoder"], CHANNELS["/camera/image"]
KEYS = {
    "/table/encoder": ("log_time_ns", "stamp_ns", "position_m", "velocity_m_s"),
    "/camera/image": ("log_time_ns", "stamp_ns", "data"),
    "/joints": ("log_time_ns", "stamp_ns", "base.y"),
    "/status": ("log_time_ns", "level", "inner.text"),
}


def write_weld(path: Path, seconds: int = 12) -> Expected:
    """As the recorder writes it: 1 kHz encoder in chunks of 0.1 s, pictures of 2 kB at 10 Hz."""
    generator = np.random.default_rng(7)
    count = 1000 * seconds
    stamps = START_NS + np.arange(count, dtype=np.int64) * 1_000_000
    columns: dict[str, Any] = {"stamp_ns": stamps, "log_time_ns": stamps + 11}
    columns |= {name: generator.normal(size=count) for name in ENCODER.field_names[1:]}
    pictures = [generator.integers(0, 256, 2000, np.uint8) for _ in range(10 * seconds)]
    with path.open("xb", buffering=0) as file:
        writer = FileWriter(file, "seamlog test")
        writer.add_metadata("seamlog.recording", {"id": "test", "index": "1"})
        for row in (ENCODER, CAMERA):
            schema = writer.add_schema(row.schema, messages.definition(row))
            writer.add_channel(row.topic, schema, {"producer": "main"})
        names = ENCODER.field_names
        rows = zip(*(columns[name].tolist() for name in names), strict=True)
        payloads = [messages.encode(ENCODER, row) for row in rows]
        for place, picture in enumerate(pictures):
            part = slice(100 * place, 100 * place + 100)
            data, offsets = payload_records(payloads, columns["log_time_ns"], part, 1, 0)
            writer.write_chunk(1, data, columns["log_time_ns"][part].view(np.uint64), offsets)
            stamp = stamps[part.start : part.start + 1]
            frame = messages.encode_image(int(stamp[0]), "camera", "jpeg", picture.tobytes())
            data, offsets = payload_records([frame], stamp, slice(0, 1), 2, place)
            writer.write_chunk(2, data, stamp.view(np.uint64), offsets, "")
        writer.finish()
    frames = stamps[::100]
    return {
        "/table/encoder": columns,
        "/camera/image": {"log_time_ns": frames, "stamp_ns": frames, "data": pictures},
    }


def write_bag(path: Path) -> Expected:
    """As the mcap package writes it: three interleaved topics, channels in one chunk only."""
    return write_foreign(path, {"chunk_size": 4000}, 3000)


def write_bag_without_summary(path: Path) -> Expected:
    """The same, killed before its end."""
    expected = write_bag(path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) - int.from_bytes(data[-28:-20], "little") % 1000 - 4000])
    return expected


def flip(data: bytes, dice: random.Random) -> bytes:
    """One bit anywhere."""
    found = bytearray(data)
    found[dice.randrange(len(found))] ^= 1 << dice.randrange(8)
    return bytes(found)


def zeros(data: bytes, dice: random.Random, size: int = 4096) -> bytes:
    """A page of zeros, aligned as on a disk."""
    at = dice.randrange(len(data) // size) * size
    return data[:at] + bytes(size) + data[at + size :]


def hole(data: bytes, dice: random.Random) -> bytes:
    """512 bytes are gone and what follows has moved up."""
    at = dice.randrange(8, len(data) - 512)
    return data[:at] + data[at + 512 :]


def noise(data: bytes, dice: random.Random) -> bytes:
    """A sector of another file."""
    at = dice.randrange(len(data) // 512) * 512
    return data[:at] + dice.randbytes(512) + data[at + 512 :]


def lengths(data: bytes, dice: random.Random) -> bytes:
    """A bit of the length of some chunk."""
    found = bytearray(data)
    places = [at for at in range(8, len(data) - 60) if data[at : at + 4] in (b"zstd", b"lz4\0")]
    at = dice.choice(places) - 40
    found[at + dice.randrange(8)] ^= 1 << dice.randrange(8)
    return bytes(found)


def cut(data: bytes, dice: random.Random) -> bytes:
    """The end is missing."""
    return data[: dice.randrange(len(data) // 50, len(data))]


DAMAGES: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "flip": flip,
    "zeros": zeros,
    "hole": hole,
    "noise": noise,
    "lengths": lengths,
    "cut": cut,
}
FILES: dict[str, Callable[[Path], Expected]] = {"weld": write_weld, "bag": write_bag}
