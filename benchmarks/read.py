"""Reading to columns beside mcap, rosbags, rerun, Parquet and the least possible work, CPU time.

Data: 10^6 messages of 36 bytes (stamp + 3 doubles) as one channel in chunks of 1 MiB; the same in
the small chunks of a live recording; a mixed session of pictures and numbers; messages of varying
length as others write them. CRCs are checked, and every reader must come to the same values.
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
from joints import (
    ALL_FIELDS,
    EVERY_JOINT,
    FIRST_JOINT,
    QUANTITIES,
    START_NS,
    Values,
    all_of_cdr,
    all_of_protobuf,
    first_of_cdr,
    first_of_protobuf,
    write_cdr,
    write_protobuf,
)
from mcap.reader import make_reader

import seamlog
from seamlog.channels import CHANNELS
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.writer import FileWriter
from seamlog.messages import definition, encode_image

TOPIC = "/table/reference"
LIVE_ROWS = 100
"""Messages per chunk of a live 1 kHz recording: 100 ms."""


def columns(count: int) -> dict[str, np.ndarray[Any, Any]]:
    """Motion at sensor resolution, 1 kHz."""
    phase = np.arange(count) / 1000.0
    position = np.round(0.1 * np.sin(phase), 6)
    noise = np.random.default_rng(0).normal(0, 5e-4, count)
    stamps = START_NS + np.arange(count) * 1_000_000
    return {
        "stamp_ns": stamps,
        "position_m": position,
        "velocity_m_s": 0.1 * np.cos(phase) + noise,
        "acceleration_m_s2": -0.1 * np.sin(phase) + 10 * noise,
    }


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


def ours(path: Path, window: tuple[int, int] | None = None) -> Values:
    """Messages read to columns."""
    with seamlog.open_session(path) as session:
        part = session.window(*window) if window else session
        return part.columns(TOPIC)["position_m"]


def by_mcap(path: Path, window: tuple[int, int] | None = None) -> Values:
    """The `mcap` package with its ROS 2 decoder, in file order, CRC checked."""
    from mcap_ros2.decoder import DecoderFactory

    limits = {"starting_at": window[0], "ending_before": window[1]} if window else {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        items = reader.iter_decoded_messages([TOPIC], log_time_order=bool(window), **limits)
        return np.array([item.decoded_message.position_m for item in items])


def by_rosbags(path: Path) -> Values:
    """rosbags, decoded."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        rows = ((c.msgtype, raw) for c, _, raw in reader.messages())
        return np.array([reader.deserialize(raw, name).position_m for name, raw in rows])


def by_rerun(path: Path) -> Values:
    """rerun's MCAP reader, all fields to numpy."""
    from rerun.chunk import McapReader

    parts = []
    for chunk in McapReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.endswith("Reference:message"):
                struct_array = batch.column(name).flatten()
                fields = {f.name: struct_array.field(f.name).to_numpy() for f in struct_array.type}
                parts.append(fields["position_m"])
    return np.concatenate(parts)


def same(found: Values, wanted: Values) -> None:
    """All readers must come to the same values."""
    if not np.array_equal(np.sort(found), np.sort(wanted)):
        raise SystemExit("two readers disagree about the values")


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
    for path in paths.values():
        same(ours(path), data["position_m"])
    with optional_peer("mcap-ros2-support"):
        same(by_mcap(few), data["position_m"][: count // 10])
        peer = cpu_s(lambda: by_mcap(few), 2) / (count // 10)
        yield Figure("zstd: mcap in file order, decoded / ours", peer / own["zstd"], "x", ">= 80")
        live = folder / "live.mcap"
        write_live(live, few, count // 10)
        same(ours(live), data["position_m"][: count // 10])
        ratio = cpu_s(lambda: by_mcap(live), 2) / cpu_s(lambda: ours(live))
        yield Figure("live chunks: mcap / ours", ratio, "x", ">= 30")
    with optional_peer("rosbags"):
        same(by_rosbags(few), data["position_m"][: count // 10])
        peer = cpu_s(lambda: by_rosbags(few), 2) / (count // 10)
        yield Figure("zstd: rosbags / ours", peer / own["zstd"], "x", ">= 50")
    with optional_peer("rerun-sdk"):
        same(by_rerun(paths["zstd"]), data["position_m"])
        peer = cpu_s(lambda: by_rerun(paths["zstd"]), 3) / count
        yield Figure("zstd: rerun / ours", peer / own["zstd"], "x", ">= 10")
    ratio = cpu_s(lambda: ours(paths["zstd"])) / cpu_s(least_work(paths["zstd"]))
    yield Figure("zstd: ours / (decompression + crc32)", ratio, "x", "<= 1.3")
    plain = parquet(folder, data, {"compression": "none", "use_dictionary": False})
    yield Figure("uncompressed: ours / Parquet, uncompressed", own[""] / plain, "x", "<= 1.3")
    usual = parquet(folder, data, {})
    yield Figure("uncompressed: ours / Parquet as pyarrow writes it", own[""] / usual, "x")


def parquet(folder: Path, data: dict[str, np.ndarray[Any, Any]], options: dict[str, Any]) -> float:
    """Seconds per row of pyarrow reading the same columns (log time too) to numpy."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "columns.parquet"
    pq.write_table(pa.table({"log_time_ns": data["stamp_ns"], **data}), path, **options)

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


def foreign(folder: Path, count: int) -> Iterator[Figure]:
    """Messages of varying length: the first joint, and every field.

    Ours come in the order of log time; mcap sorts by it unless it is told to keep the file's order.
    """
    with optional_peer("mcap-ros2-support, mcap-protobuf-support, foxglove-sdk"):
        from mcap_protobuf.decoder import DecoderFactory as Protobuf
        from mcap_ros2.decoder import DecoderFactory as Ros2

        cdr = ("cdr", write_cdr, first_of_cdr, all_of_cdr)
        protobuf = ("protobuf", write_protobuf, first_of_protobuf, all_of_protobuf)
        for encoding, write_file, first, whole in (cdr, protobuf):
            path, few = folder / f"{encoding}.mcap", folder / f"{encoding}_few.mcap"
            write_file(path, count)
            write_file(few, count // 10)
            names = QUANTITIES[encoding]
            picked = [FIRST_JOINT[encoding].format(name) for name in names]
            fields = [*ALL_FIELDS[encoding], *(EVERY_JOINT[encoding].format(n) for n in names)]
            for told, wanted, pick in (
                ("first joint", picked, first),
                ("all fields", fields, whole),
            ):
                name, target = f"varying {encoding}, {told}", ">= 50" if pick is first else ""
                agree(columns_of(few, wanted), wanted, decoded(few, pick, Ros2, Protobuf))
                own = cpu_s(lambda p=path, f=wanted: columns_of(p, f)) / count
                peer = (count // 10, few, pick, Ros2, Protobuf)
                yield Figure(f"{name}: mcap / ours", peer_s(False, *peer) / own, "x", target)
                yield Figure(f"{name}: mcap by time / ours", peer_s(True, *peer) / own, "x")
            ratio = peer_s(False, count // 10, few, first, Ros2, Protobuf)
            ratio /= cpu_s(least_work(path)) / count
            yield Figure(f"varying {encoding}: mcap / (decompression + crc32)", ratio, "x")


def peer_s(
    by_time: bool, count: int, path: Path, pick: Callable[..., Any], *factories: Any
) -> float:
    """Seconds a message."""
    return cpu_s(lambda: decoded(path, pick, *factories, by_time=by_time), 3) / count


def columns_of(path: Path, fields: list[str]) -> dict[str, Values]:
    """Columns of the joint states."""
    with seamlog.open_session(path) as session:
        return session.columns("/joints", fields)


def decoded(
    path: Path, pick: Callable[..., Any], *factories: Any, by_time: bool = False
) -> list[tuple[Any, ...]]:
    """What `pick` takes out of every message, decoded by mcap, CRC checked."""
    with path.open("rb") as file:
        made = [factory() for factory in factories]
        reader = make_reader(file, validate_crcs=True, decoder_factories=made)
        items = reader.iter_decoded_messages(["/joints"], log_time_order=by_time)
        return [pick(item.decoded_message) for item in items]


def agree(columns: dict[str, Values], fields: list[str], rows: list[tuple[Any, ...]]) -> None:
    """Every field of every message must be the same."""
    for field, wanted in zip(fields, zip(*rows, strict=True), strict=True):
        pairs = zip(columns[field], wanted, strict=True)
        if not all(np.array_equal(one, other) for one, other in pairs):
            raise SystemExit(f"two readers disagree about {field}")


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
        figures += foreign(folder, count // 5)
        if not chosen.quick:
            figures += opening(folder)
    tell("read: CPU time beside peers in one run", figures, chosen.json)


if __name__ == "__main__":
    main()
