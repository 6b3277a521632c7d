"""The pictures of a topic as a video file with their own time stamps, through PyAV."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import EvidenceError, FrameMissing, HardwareError
from seamlog.files import replacing
from seamlog.session import Session

_TICK = Fraction(1, 90_000)
"""Time base of MPEG; a stamp moves by at most 6 us."""
_TV, _BT601 = 1, 5
"""Codes of H.264 for the range and the matrix of colours."""


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
            copy = kind == "matroska" and all(_is_jpeg(frame) for frame in frames[:1])
            write = _copy_all if copy else _encode_all
            return write(container, frames, first, av)


def _is_jpeg(frame: Any) -> bool:
    return bool(frame.data[:2] == b"\xff\xd8")


def _ticks(stamp_ns: int, first_ns: int) -> int:
    return round((stamp_ns - first_ns) * _TICK.denominator / 1_000_000_000)


def _copy_all(container: Any, frames: Any, first_ns: int, av: Any) -> int:
    stream = _stream(container, "mjpeg", frames[0].image().shape, "yuvj420p")
    count = 0
    for frame in _in_order(frames):
        if not _is_jpeg(frame):
            raise EvidenceError(
                f"{frame.where}: a picture of another kind among JPEGs; export .mp4, which encodes "
                "them anew"
            )
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
    shape: tuple[int, ...] = ()
    for frame in _in_order(frames):
        image = frame.image()
        if stream is None:
            shape = image.shape[:2]
            stream = _stream(container, "libx264", shape, "yuv420p")
        if image.shape[:2] != shape:
            raise EvidenceError(
                f"{frame.where}: a picture of {image.shape[1]} x {image.shape[0]} pixels after "
                f"{shape[1]} x {shape[0]}; export .mkv, which keeps them, or each range alone"
            )
        picture = av.VideoFrame.from_ndarray(_planes(image), format="yuv420p")
        last = picture.pts = max(_ticks(frame.stamp_ns, first_ns), last + 1)
        picture.time_base = _TICK
        container.mux(stream.encode(picture))
        count += 1
    if stream is not None:
        container.mux(stream.encode(None))
    return count


def _planes(image: NDArray[Any]) -> NDArray[Any]:
    """Pixels as H.264 has them (BT.601, limited range), an odd last row or column doubled.

    By OpenCV, which rounds; swscale cuts, and pictures come out up to 3 grey levels darker.
    """
    import cv2

    colours = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image
    down, right = image.shape[0] & 1, image.shape[1] & 1
    even = cv2.copyMakeBorder(colours, 0, down, 0, right, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.cvtColor(even, cv2.COLOR_BGR2YUV_I420))


def _in_order(frames: Any) -> Any:
    for place in np.argsort(frames.stamps_ns, kind="stable").tolist():
        try:
            yield frames[place]
        except FrameMissing:
            continue


def _stream(container: Any, codec: str, shape: tuple[int, ...], pixels: str) -> Any:
    stream = container.add_stream(codec, rate=1000)
    stream.height, stream.width = shape[:2]
    if codec == "libx264":
        stream.height, stream.width = shape[0] + (shape[0] & 1), shape[1] + (shape[1] & 1)
        stream.codec_context.color_range, stream.codec_context.colorspace = _TV, _BT601
    stream.pix_fmt, stream.time_base = pixels, _TICK
    stream.codec_context.time_base = _TICK
    return stream
