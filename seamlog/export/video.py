"""The pictures of a topic as a video file with their own time stamps, through PyAV."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.errors import EvidenceError, FrameMissing, HardwareError
from seamlog.files import replacing
from seamlog.session import Session

_TICK = Fraction(1, 90_000)
"""Time base of MPEG; a stamp moves by at most 6 us."""


def write_video(session: Session, topic: str, path: Path, force: bool) -> int:
    """Number of frames written; damaged pictures are left out (see `session.problems`).

    `.mkv` takes JPEG pictures over as they are, with stamps of whole ms; anything else is encoded
    as H.264.
    """
    try:
        import av
    except ImportError as error:
        raise HardwareError("video is written by PyAV: pip install 'seamlog[video]'") from error
    frames = session.frames(topic)
    if not len(frames):
        raise EvidenceError(f"{session.path}: {topic} has no pictures in this range")
    with replacing(path, force) as partial:
        kind = {".mkv": "matroska", ".mov": "mov", ".webm": "webm"}.get(path.suffix.lower(), "mp4")
        with av.open(str(partial), "w", format=kind) as container:
            first = int(frames.stamps_ns.min())
            container.metadata["creation_time"] = f"{np.datetime64(first, 'ns')}Z"
            copy = kind == "matroska" and all(f.format == "jpeg" for f in frames[:1])
            write = _copy_all if copy else _encode_all
            return write(container, frames, first, av)


def _ticks(stamp_ns: int, first_ns: int) -> int:
    return round((stamp_ns - first_ns) * _TICK.denominator / 1_000_000_000)


def _copy_all(container: Any, frames: Any, first_ns: int, av: Any) -> int:
    stream = _stream(container, "mjpeg", frames[0].image().shape, "yuvj420p")
    count = 0
    for frame in _in_order(frames):
        packet = av.Packet(frame.data)
        packet.stream = stream
        packet.pts = packet.dts = _ticks(frame.stamp_ns, first_ns)
        packet.time_base = _TICK
        packet.is_keyframe = True
        container.mux(packet)
        count += 1
    return count


def _encode_all(container: Any, frames: Any, first_ns: int, av: Any) -> int:
    stream, count, last = None, 0, -1
    for frame in _in_order(frames):
        image = frame.image()
        image = np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image
        image = np.ascontiguousarray(image[: image.shape[0] & ~1, : image.shape[1] & ~1])
        if stream is None:
            stream = _stream(container, "libx264", image.shape, "yuv420p")
        picture = av.VideoFrame.from_ndarray(image, format="bgr24")
        last = picture.pts = max(_ticks(frame.stamp_ns, first_ns), last + 1)
        picture.time_base = _TICK
        container.mux(stream.encode(picture))
        count += 1
    if stream is not None:
        container.mux(stream.encode(None))
    return count


def _in_order(frames: Any) -> Any:
    for place in np.argsort(frames.stamps_ns, kind="stable").tolist():
        try:
            yield frames[place]
        except FrameMissing:
            continue


def _stream(container: Any, codec: str, shape: tuple[int, ...], pixels: str) -> Any:
    stream = container.add_stream(codec, rate=1000)
    stream.height, stream.width = shape[0] & ~1, shape[1] & ~1
    if codec == "mjpeg":
        stream.height, stream.width = shape[:2]
    stream.pix_fmt, stream.time_base = pixels, _TICK
    stream.codec_context.time_base = _TICK
    return stream
