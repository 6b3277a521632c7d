"""Recording beside mcap and foxglove-sdk on the same data: what the live loop pays, and the file.

Data: messages of 36 bytes (stamp + 3 doubles), pictures of 640 x 480 in colour and grey, JPEGs of
30 kB. Paced: 1 kHz encoder + 30 fps, always beside an empty loop
and one that only copies its pictures. Peers write in the loop, as their
users do, and make JPEGs of raw pictures there.
"""

import itertools
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from figures import Figure, cpu_s, optional_peer, options, tell
from loops import (
    PICTURES,
    TOPIC,
    Loop,
    Picture,
    copying_loop,
    foxglove_loop,
    mcap_loop,
    no_loop,
    own_loop,
)
from mcap.writer import Writer

from seamlog.channels import CHANNELS
from seamlog.mcap.batch import BatchWriter
from seamlog.messages import definition, encode_image
from seamlog.recorder import Recorder

START_NS = 1_767_225_600_000_000_000
BATCH = 10_000
"""Messages between two pauses in which the recorder process empties the ring."""


def call_us(
    number: Callable[[int, float, float, float], Any],
    rounds: int,
    settle: Callable[[], None] = lambda: None,
) -> float:
    """CPU time of the calling thread per message, least mean of six blocks of rounds."""
    blocks = []
    for _ in range(6):
        spent = 0.0
        for _ in range(rounds):
            start = time.thread_time()
            for i in range(BATCH):
                number(START_NS + i, 0.1, 0.2, 0.3)
            spent += time.thread_time() - start
            settle()
        blocks.append(spent / rounds / BATCH * 1e6)
    return min(blocks)


def caller(folder: Path, rounds: int) -> Iterator[Figure]:
    """What one call costs the loop, packing included."""
    with ExitStack() as stack:
        recorder = stack.enter_context(Recorder(folder / "caller.mcap", force=True))
        put = recorder.channel(TOPIC).put

        def settle() -> None:
            while recorder.status().channels[0].waiting:
                time.sleep(0.005)

        put(START_NS, 0.1, 0.2, 0.3)
        settle()
        own = call_us(put, rounds, settle)
        by_name = call_us(
            lambda t, a, b, c: recorder.log(
                TOPIC, t, position_m=a, velocity_m_s=b, acceleration_m_s2=c
            ),
            rounds,
            settle,
        )
        account = recorder.status().channels[0]
    with ExitStack() as stack:
        peer = call_us(mcap_loop(stack, folder).number, rounds)
    yield Figure("one channel.put", own, "us")
    yield Figure("one recorder.log", by_name, "us")
    yield Figure("one mcap add_message", peer, "us")
    yield Figure("mcap add_message / put", peer / own, "x", ">= 6")
    yield Figure("mcap add_message / log", peer / by_name, "x", ">= 3")
    yield Figure("dropped while measuring", account.dropped, "msg", "<= 0")
    with optional_peer("foxglove-sdk"), ExitStack() as stack:
        peer = call_us(foxglove_loop(stack, folder).number, rounds)
        yield Figure("foxglove log / put", peer / own, "x", ">= 1")


class Latencies(NamedTuple):
    """Seconds of single calls in a paced loop."""

    numbers_s: np.ndarray[Any, Any]
    pictures_s: np.ndarray[Any, Any]


def paced(loop: Loop, images: Sequence[Picture] | Sequence[bytes], seconds: float) -> Latencies:
    """1 kHz + 30 fps for a while; a raw picture has just been read from the camera."""
    numbers, pictures = [], []
    start = time.perf_counter()
    for tick in range(int(seconds * 1000)):
        time.sleep(max(0.0, start + tick * 0.001 - time.perf_counter()))
        stamp = time.time_ns()
        before = time.perf_counter()
        loop.number(stamp, 0.1, 0.2, 0.3)
        numbers.append(time.perf_counter() - before)
        if tick * 30 // 1000 == len(pictures):
            pictures.append(picture_s(loop, stamp, images[len(pictures) % len(images)]))
    return Latencies(np.array(numbers), np.array(pictures))


def picture_s(loop: Loop, stamp: int, image: Picture | bytes) -> float:
    """Seconds that a picture costs the loop, without the camera's read of a raw one before."""
    spent = 0.0
    log: Callable[[int, Any], Any] = loop.picture
    if isinstance(image, bytes):
        log = loop.encoded
    elif loop.room is None:
        image = np.copy(image)
    else:
        before = time.perf_counter()
        room = loop.room(image.shape)
        spent = time.perf_counter() - before
        np.copyto(room, image)
        image = room
    before = time.perf_counter()
    log(stamp, image)
    return spent + time.perf_counter() - before


def paced_beside_peers(
    folder: Path, images: Sequence[Picture] | Sequence[bytes], seconds: float
) -> dict[str, Latencies]:
    """The paced loop, empty and with each writer."""
    rows: dict[str, Latencies] = {}
    makers: dict[str, Callable[[ExitStack, Path], Loop]] = {
        "empty": no_loop,
        "copy alone": copying_loop,
        "seamlog": own_loop,
        "seamlog, lent": partial(own_loop, is_lent=True),
        "mcap": mcap_loop,
        "foxglove-zstd": foxglove_loop,
    }
    if isinstance(images[0], bytes):
        del makers["copy alone"], makers["seamlog, lent"]
    for name, make in makers.items():
        with optional_peer(name), ExitStack() as stack:
            loop = make(stack, folder)
            time.sleep(0.5)
            rows[name] = paced(loop, images, seconds)
    return rows


def tails(folder: Path, seconds: float) -> Iterator[Figure]:
    """Tail latencies of the paced loop, with each kind of pictures."""
    colour = pictures_640(64)
    rows = paced_beside_peers(folder, colour, seconds)
    yield from sizes(folder)
    yield from encoder_tails(rows)
    yield from picture_tails("colour", rows)
    grey = [np.ascontiguousarray(image[:, :, 1]) for image in colour]
    yield from picture_tails("grey", paced_beside_peers(folder, grey, seconds))
    yield from picture_tails("JPEG", paced_beside_peers(folder, jpegs(64), seconds))


def encoder_tails(rows: dict[str, Latencies]) -> Iterator[Figure]:
    """The slowest of a thousand encoder messages."""
    tail_ms = {n: float(np.percentile(row.numbers_s, 99.9)) * 1e3 for n, row in rows.items()}
    for name, value in tail_ms.items():
        bound = "<= 0.5" if name == "seamlog" else ""
        yield Figure(f"paced: encoder p99.9, {name}", value, "ms", bound)
    if "foxglove-zstd" in rows:
        ratio = tail_ms["foxglove-zstd"] / tail_ms["seamlog"]
        yield Figure("paced: encoder p99.9, foxglove-zstd / ours", ratio, "x", ">= 10")


def picture_tails(kind: str, rows: dict[str, Latencies]) -> Iterator[Figure]:
    """The slowest of a hundred pictures."""
    tail_ms = {n: float(np.percentile(row.pictures_s, 99)) * 1e3 for n, row in rows.items()}
    for name, value in tail_ms.items():
        yield Figure(f"paced: {kind} picture p99, {name}", value, "ms")
    for name in ("seamlog", "seamlog, lent"):
        if name in rows:
            ratio = tail_ms["mcap"] / tail_ms[name]
            yield Figure(f"paced: {kind} picture p99, mcap / {name}", ratio, "x", ">= 30")


def sizes(folder: Path) -> Iterator[Figure]:
    """Files of the paced loops: the same messages and pictures."""
    own = (folder / "own.mcap").stat().st_size
    yield Figure("paced: file", own / 1e6, "MB")
    for name in ("mcap", "foxglove-True"):
        peer = folder / f"{name}.mcap"
        if peer.exists():
            label = name.replace("-True", "-zstd")
            yield Figure(f"paced: file, ours / {label}", own / peer.stat().st_size, "x")


def pictures_640(count: int) -> list[Picture]:
    """Colour pictures with a bright line and noise."""
    generator = np.random.default_rng(0)
    found = []
    for i in range(count):
        image = generator.normal(90, 12, (480, 640, 3)).clip(0, 255).astype(np.uint8)
        image[:, 300 + i : 306 + i] = 240
        found.append(cv2.GaussianBlur(image, (5, 5), 0))
    return found


def batches(folder: Path, count: int) -> Iterator[Figure]:
    """Whole columns at once, against the `mcap` package one message at a time."""
    phase = np.arange(count) / 1000.0
    position = np.round(0.1 * np.sin(phase), 6)
    columns = {
        "stamp_ns": START_NS + np.arange(count) * 1_000_000,
        "position_m": position,
        "velocity_m_s": 0.1 * np.cos(phase),
        "acceleration_m_s2": -position,
    }
    rows = list(zip(*(column[: count // 5].tolist() for column in columns.values()), strict=True))

    def by_mcap() -> None:
        with ExitStack() as stack:
            number = mcap_loop(stack, folder).number
            for row in rows:
                number(*row)

    peer = cpu_s(by_mcap, 3) / len(rows)
    for compression, target in (("", ">= 45"), ("lz4", ">= 25"), ("zstd", ">= 13")):

        def by_batch(compression: str = compression) -> None:
            path = folder / "batch.mcap"
            with BatchWriter(path, force=True, compression=compression) as writer:
                writer.write(TOPIC, columns)

        own = cpu_s(by_batch) / count
        name = compression or "none"
        yield Figure(f"batch {name}", own * 1e6, "us/msg")
        yield Figure(f"batch {name}: mcap one by one / ours", peer / own, "x", target)


def frames(folder: Path, count: int) -> Iterator[Figure]:
    """Pictures of 30 kB into a file, encoded before: CPU time and, for the recorder, throughput."""
    blocks = jpegs(64)
    row = CHANNELS[PICTURES]

    def payloads() -> Iterator[tuple[int, bytes]]:
        for i in range(count):
            yield START_NS + i, encode_image(START_NS + i, "camera", "jpeg", blocks[i % 64])

    def ours() -> None:
        source = payloads()
        with BatchWriter(folder / "frames.mcap", force=True) as writer:
            while part := list(itertools.islice(source, 32)):
                stamps, made = zip(*part, strict=True)
                writer.write_payloads(PICTURES, row, made, stamps)

    def by_mcap() -> None:
        with (folder / "frames-mcap.mcap").open("wb") as file:
            writer = Writer(file)
            writer.start("ros2", "benchmark")
            schema = writer.register_schema(row.schema, "ros2msg", definition(row).encode())
            channel = writer.register_channel(PICTURES, "cdr", schema)
            for stamp, payload in payloads():
                writer.add_message(channel, stamp, payload, stamp)
            writer.finish()

    def by_foxglove() -> None:
        import foxglove
        from foxglove.mcap import MCAPWriteOptions

        context = foxglove.Context()
        written = MCAPWriteOptions(compression=None, profile="ros2")
        path = folder / "frames-foxglove.mcap"
        with foxglove.open_mcap(
            path, allow_overwrite=True, context=context, writer_options=written
        ):
            schema = foxglove.Schema(
                name=row.schema, encoding="ros2msg", data=definition(row).encode()
            )
            channel = foxglove.Channel(
                PICTURES, schema=schema, message_encoding="cdr", context=context
            )
            for stamp, payload in payloads():
                channel.log(payload, log_time=stamp)

    own = cpu_s(ours) / count
    yield Figure("pictures of 30 kB", own * 1e6, "us")
    yield Figure("pictures: mcap / ours", cpu_s(by_mcap, 3) / count / own, "x", ">= 3.5")
    with optional_peer("foxglove-sdk"):
        ratio = cpu_s(by_foxglove) / count / own
        yield Figure("pictures: foxglove uncompressed / ours", ratio, "x", ">= 0.95")
    yield Figure("pictures through the recorder", through_recorder(folder, blocks, count), "MB/s")


def jpegs(count: int) -> list[bytes]:
    """Different JPEGs of about 30 kB; more of them than a chunk of any writer holds."""
    images = pictures_640(count)
    return [
        cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, 84))[1].tobytes() for image in images
    ]


def through_recorder(folder: Path, blocks: list[bytes], count: int) -> float:
    """Encoded pictures through ring and recorder process into the file."""
    with Recorder(folder / "through.mcap", pace="simulated", force=True) as recorder:
        put = recorder.channel(PICTURES).put
        put(START_NS, "camera", "jpeg", blocks[0])
        while recorder.status().channels[0].waiting:
            time.sleep(0.005)
        start = time.perf_counter()
        for i in range(count):
            put(START_NS + i, "camera", "jpeg", blocks[i % 64])
        while recorder.status().channels[0].waiting:
            time.sleep(0.001)
        return sum(map(len, blocks)) / len(blocks) * count / 1e6 / (time.perf_counter() - start)


def main() -> None:
    """Run all and tell."""
    chosen = options(__doc__)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        figures = [
            *caller(folder, 3 if chosen.quick else 10),
            *tails(folder, 3.0 if chosen.quick else 15.0),
            *batches(folder, 200_000 if chosen.quick else 1_000_000),
            *frames(folder, 500 if chosen.quick else 3000),
        ]
    tell("record: beside peers in one run", figures, chosen.json)


if __name__ == "__main__":
    main()
