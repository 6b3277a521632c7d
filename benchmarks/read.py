"""Reading to columns beside mcap, rosbags, Parquet and the least possible work, CPU time.

Data: 10^6 encoder messages (stamp + 2 doubles) as one channel; a mixed session of pictures and
numbers; the same numbers in the small chunks of a live recording.
"""

import struct
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from figures import Figure, cpu_s, optional_peer, options, tell
from mcap.reader import make_reader

import seamlog
from seamlog.channels import CHANNELS
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.writer import FileWriter
from seamlog.messages import definition, encode_image

TOPIC = "/table/encoder"
START_NS = 1_767_225_600_000_000_000
LIVE_ROWS = 100
"""Messages per chunk of a live 1 kHz recording: 100 ms."""


def columns(count: int) -> dict[str, np.ndarray[Any, Any]]:
    """An encoder at sensor resolution, 1 kHz."""
    phase = np.arange(count) / 1000.0
    position = np.round(0.1 * np.sin(phase), 6)
    noise = np.random.default_rng(0).normal(0, 5e-4, count)
    stamps = START_NS + np.arange(count) * 1_000_000
    return {"stamp_ns": stamps, "position_m": position, "velocity_m_s": 0.1 * np.cos(phase) + noise}


def write(path: Path, data: dict[str, np.ndarray[Any, Any]], compression: str) -> None:
    """One channel in large chunks."""
    with BatchWriter(path, force=True, compression=compression) as writer:
        writer.write(TOPIC, data)


def write_live(path: Path, source: Path, count: int) -> None:
    """The same records in chunks of 100 ms that stand alone, as a recorder writes them."""
    with source.open("rb") as file:
        records = [m.data for _, _, m in make_reader(file).iter_messages([TOPIC])][:count]
    channel = CHANNELS[TOPIC]
    width = len(records[0])
    head = "<BQHIQQ"
    form = np.dtype(
        {
            "names": ["op", "len", "ch", "seq", "t", "p", "data"],
            "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8", f"V{width}"],
            "offsets": [0, 1, 9, 11, 15, 23, struct.calcsize(head)],
        }
    )
    with path.open("wb", buffering=0) as file:
        writer = FileWriter(file, "benchmark")
        number = writer.add_channel(
            topic=TOPIC,
            schema_id=writer.schema_id(channel.schema, definition(channel)),
            metadata={},
        )
        times = START_NS + np.arange(count) * 1_000_000
        for start in range(0, count, LIVE_ROWS):
            part = np.zeros(min(LIVE_ROWS, count - start), form)
            part["op"], part["len"], part["ch"] = 5, form.itemsize - 9, number
            part["seq"] = np.arange(start, start + len(part))
            part["t"] = part["p"] = times[start : start + len(part)]
            part["data"] = np.array(records[start : start + len(part)], f"V{width}")
            offsets = np.arange(len(part), dtype=np.uint64) * np.uint64(form.itemsize)
            writer.write_chunk(number, part.tobytes(), part["t"].copy(), offsets, "zstd")
        writer.finish()


def write_mixed(path: Path, data: dict[str, np.ndarray[Any, Any]], frames: int) -> None:
    """Numbers and pictures of 30 kB side by side."""
    picture = np.random.default_rng(1).integers(0, 255, 30_000, np.uint8).tobytes()
    stamps = np.linspace(data["stamp_ns"][0], data["stamp_ns"][-1], frames).astype(np.int64)
    payloads = [encode_image(int(stamp), "camera", "jpeg", picture) for stamp in stamps]
    with BatchWriter(path, force=True) as writer:
        writer.write(TOPIC, data)
        writer.write_payloads("/camera/image", CHANNELS["/camera/image"], payloads, stamps)


def ours(path: Path, window: tuple[int, int] | None = None) -> int:
    """Messages read to columns."""
    with seamlog.open_session(path) as session:
        part = session.window(*window) if window else session
        return len(part.columns(TOPIC)["position_m"])


def by_mcap(path: Path, window: tuple[int, int] | None = None) -> int:
    """The `mcap` package with its ROS 2 decoder, in file order, CRC checked."""
    from mcap_ros2.decoder import DecoderFactory

    limits = {"starting_at": window[0], "ending_before": window[1]} if window else {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        items = reader.iter_decoded_messages([TOPIC], log_time_order=bool(window), **limits)
        return sum(1 for item in items if item.decoded_message.position_m < 9)


def by_rosbags(path: Path) -> int:
    """rosbags, decoded."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        return sum(
            1
            for c, _, raw in reader.messages()
            if reader.deserialize(raw, c.msgtype).position_m < 9
        )


def least_work(path: Path) -> Callable[[], int]:
    """Decompression and CRC of the same chunks and nothing else."""
    from mcap.stream_reader import StreamReader

    with path.open("rb") as file:
        chunks = [
            (record.data, record.uncompressed_size)
            for record in StreamReader(file, emit_chunks=True).records
            if type(record).__name__ == "Chunk"
        ]

    def act() -> int:
        decompressor = zstandard.ZstdDecompressor()
        return sum(zlib.crc32(decompressor.decompress(d, max_output_size=n)) for d, n in chunks)

    return act


def single_channel(folder: Path, count: int) -> Iterator[Figure]:
    """One channel in large chunks, in live chunks, and its peers."""
    data = columns(count)
    paths = {name: folder / f"{name or 'none'}.mcap" for name in ("zstd", "lz4", "")}
    for compression, path in paths.items():
        write(path, data, compression)
    few = folder / "few.mcap"
    write(few, {name: column[: count // 10] for name, column in data.items()}, "zstd")
    own = {name: cpu_s(lambda p=path: ours(p)) / count for name, path in paths.items()}
    for name, seconds in own.items():
        yield Figure(f"read {name or 'uncompressed'}", seconds * 1e6, "us/msg")
    with optional_peer("mcap-ros2-support"):
        peer = cpu_s(lambda: by_mcap(few), 2) / (count // 10)
        yield Figure("zstd: mcap in file order, decoded / ours", peer / own["zstd"], "x", ">= 80")
        live = folder / "live.mcap"
        write_live(live, few, count // 10)
        ratio = cpu_s(lambda: by_mcap(live), 2) / cpu_s(lambda: ours(live))
        yield Figure("live chunks: mcap / ours", ratio, "x", ">= 30")
    with optional_peer("rosbags"):
        peer = cpu_s(lambda: by_rosbags(few), 2) / (count // 10)
        yield Figure("zstd: rosbags / ours", peer / own["zstd"], "x", ">= 50")
    ratio = cpu_s(lambda: ours(paths["zstd"])) / cpu_s(least_work(paths["zstd"]))
    yield Figure("zstd: ours / (decompression + crc32)", ratio, "x", "<= 1.3")
    yield Figure("uncompressed: ours / Parquet", own[""] / parquet(folder, data), "x", "<= 1.3")


def parquet(folder: Path, data: dict[str, np.ndarray[Any, Any]]) -> float:
    """Seconds per row of pyarrow reading the same columns, uncompressed, to numpy."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "columns.parquet"
    pq.write_table(pa.table(data), path, compression="none", use_dictionary=False)

    def act() -> None:
        table = pq.read_table(path, use_threads=False)
        for name in table.column_names:
            table[name].to_numpy()

    return cpu_s(act) / len(data["stamp_ns"])


def mixed(folder: Path, count: int, frames: int) -> Iterator[Figure]:
    """One numeric channel, and one second, out of a session of mostly pictures."""
    path = folder / "mixed.mcap"
    data = columns(count)
    write_mixed(path, data, frames)
    second = (int(data["stamp_ns"][count // 2]), int(data["stamp_ns"][count // 2]) + 10**9)
    yield Figure("mixed session", path.stat().st_size / 1e6, "MB")
    with optional_peer("mcap-ros2-support"):
        own = cpu_s(lambda: ours(path))
        yield Figure(
            "mixed: one channel, mcap / ours", cpu_s(lambda: by_mcap(path), 2) / own, "x", ">= 40"
        )
        own, peer = cpu_s(lambda: ours(path, second)), cpu_s(lambda: by_mcap(path, second), 3)
        yield Figure("mixed: one second, mcap / ours", peer / own, "x", ">= 8")
    with seamlog.open_session(path) as session:
        pictures = session.frames()
        warm = cpu_s(lambda: pictures.at(second[0]).data)
    yield Figure("picture at a time, warm", warm * 1e3, "ms")


def opening(folder: Path) -> Iterator[Figure]:
    """`seamlog info` on a session of 1 GB, as a whole process."""
    import resource
    import subprocess

    path = folder / "large.mcap"
    write_mixed(path, columns(1_000_000), 32_000)
    words = [sys.executable, "-m", "seamlog", "info", str(path), "--json"]
    best = float("inf")
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(words, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        best = min(best, used)
    yield Figure(f"info on {path.stat().st_size / 1e9:.2f} GB", best, "s", "<= 0.5")


def main() -> None:
    """Run all and tell."""
    chosen = options(__doc__)
    count, frames = (200_000, 600) if chosen.quick else (1_000_000, 5_500)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        figures = [*single_channel(folder, count), *mixed(folder, count // 10, frames)]
        if not chosen.quick:
            figures += opening(folder)
    tell("read: CPU time beside peers in one run", figures, chosen.json)


if __name__ == "__main__":
    main()
