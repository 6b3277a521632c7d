"""What a live loop calls to log: ours, the `mcap` package, foxglove-sdk, and nothing at all."""

import mmap
import struct
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
from mcap.writer import Writer

from seamlog.channels import CHANNELS
from seamlog.messages import CDR_HEADER_INT, definition, encode_image, layout
from seamlog.recorder import Recorder

TOPIC, PICTURES = "/table/reference", "/camera/image"
PAYLOAD = struct.Struct("<I" + layout(TOPIC).codes)
COPIES_BYTES = 128 << 20
"""As much shared memory as the recorder takes for pictures."""
Picture: TypeAlias = np.ndarray[Any, Any]


class Loop(NamedTuple):
    """What a live loop calls."""

    number: Callable[[int, float, float, float], Any]
    picture: Callable[[int, Picture], Any]
    encoded: Callable[[int, bytes], Any]
    room: Callable[[tuple[int, ...]], Picture] | None = None
    """Lends memory for the camera to read a picture of a shape into."""


def jpeg(image: Picture) -> bytes:
    """The picture as the recorder encodes it."""
    return cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, 90))[1].tobytes()


def no_loop(_stack: ExitStack, _folder: Path) -> Loop:
    """An empty control."""
    return Loop(lambda _t, _a, _b, _c: None, lambda _t, _image: None, lambda _t, _data: None)


def copying_loop(_stack: ExitStack, _folder: Path) -> Loop:
    """A control that copies each picture into shared memory and does nothing else."""
    flags = mmap.MAP_SHARED | mmap.MAP_ANONYMOUS | mmap.MAP_POPULATE
    room = memoryview(mmap.mmap(-1, COPIES_BYTES, flags))
    place = 0

    def copied(_t: int, image: Picture) -> None:
        nonlocal place
        pixels = memoryview(image).cast("B")
        place = place if place + len(pixels) <= len(room) else 0
        room[place : place + len(pixels)] = pixels
        place += len(pixels)

    return Loop(lambda _t, _a, _b, _c: None, copied, lambda _t, _data: None)


def own_loop(stack: ExitStack, folder: Path, is_lent: bool = False) -> Loop:
    """The recorder; its camera reads into memory of its own, or into the recorder's."""
    recorder = stack.enter_context(Recorder(folder / "own.mcap", force=True))
    camera = recorder.channel(PICTURES)
    loop = Loop(
        recorder.channel(TOPIC).put,
        camera.put_frame,
        lambda stamp, data: camera.put(stamp, "camera", "jpeg", data),
    )
    return loop._replace(room=camera.loan_frame) if is_lent else loop


def mcap_loop(stack: ExitStack, folder: Path) -> Loop:
    """The `mcap` package as it comes: zstd, chunks of 1 MiB."""
    writer = Writer(stack.enter_context((folder / "mcap.mcap").open("wb")))
    writer.start("ros2", "benchmark")
    stack.callback(writer.finish)
    ids = {
        topic: writer.register_channel(
            topic,
            "cdr",
            writer.register_schema(
                CHANNELS[topic].schema, "ros2msg", definition(CHANNELS[topic]).encode()
            ),
        )
        for topic in (TOPIC, PICTURES)
    }
    number, picture, add, pack = ids[TOPIC], ids[PICTURES], writer.add_message, PAYLOAD.pack
    sequence = iter(range(1 << 32)).__next__

    def encoded(t: int, data: bytes) -> None:
        add(picture, time.time_ns(), encode_image(t, "camera", "jpeg", data), t, 0)

    return Loop(
        lambda t, a, b, c: add(
            number, time.time_ns(), pack(CDR_HEADER_INT, t, a, b, c), t, sequence()
        ),
        lambda t, image: encoded(t, jpeg(image)),
        encoded,
    )


def foxglove_loop(stack: ExitStack, folder: Path, compressed: bool = True) -> Loop:
    """foxglove-sdk, zstd as it comes or uncompressed."""
    import foxglove
    from foxglove.mcap import MCAPCompression, MCAPWriteOptions

    context = foxglove.Context()
    stack.callback(lambda: context)
    zstd = MCAPCompression.Zstd if compressed else None
    written = MCAPWriteOptions(compression=zstd, profile="ros2")
    path = folder / f"foxglove-{compressed}.mcap"
    stack.enter_context(
        foxglove.open_mcap(path, allow_overwrite=True, context=context, writer_options=written)
    )
    number, picture = (
        foxglove.Channel(
            topic,
            schema=foxglove.Schema(
                name=CHANNELS[topic].schema,
                encoding="ros2msg",
                data=definition(CHANNELS[topic]).encode(),
            ),
            message_encoding="cdr",
            context=context,
        )
        for topic in (TOPIC, PICTURES)
    )
    log, pack = number.log, PAYLOAD.pack

    def encoded(t: int, data: bytes) -> None:
        picture.log(encode_image(t, "camera", "jpeg", data), log_time=time.time_ns())

    return Loop(
        lambda t, a, b, c: log(pack(CDR_HEADER_INT, t, a, b, c), log_time=time.time_ns()),
        lambda t, image: encoded(t, jpeg(image)),
        encoded,
    )
