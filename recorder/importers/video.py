"""Video files with their own time stamps, through PyAV."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.channels import CHANNELS
from seamlog.errors import HardwareError, ImportFailed
from seamlog.mcap.batch import BatchWriter
from seamlog.mcap.records import Schema
from seamlog.messages import definition, encode_image

from .content import Report

TOPIC = "/camera/image"
_QUALITY = 95
_BARE = ("mjpeg", "h264", "hevc", "m4v", "mpegvideo", "image2", "jpeg_pipe", "png_pipe")
"""Formats of pictures in a row, without times."""


class VideoImporter:
    """Turns the first video stream of a file into pictures (JPEG, quality 95).

    The stamp of a frame is the start of the recording (`creation_time` in the file, else 1970)
    plus its presentation time. Motion JPEG is taken over without encoding it anew.
    """

    def write(self, path: Path, writer: BatchWriter) -> Report:
        """Copy all frames into `writer`; what was lost or had to be decided."""
        try:
            import av
        except ImportError as error:
            raise HardwareError(
                f"{path}: video files are read by PyAV: pip install 'seamlog[video]'"
            ) from error
        try:
            with av.open(str(path)) as container:
                return _copy(container, path, writer)
        except av.error.FFmpegError as error:
            raise ImportFailed(f"{path} cannot be read as a video: {error}") from error


def _copy(container: Any, path: Path, writer: BatchWriter) -> Report:
    if not container.streams.video:
        raise ImportFailed(f"{path} has no video stream")
    stream = container.streams.video[0]
    start_ns, notes = _start(container, stream)
    if container.format.name in _BARE:
        notes.append(
            f"a bare {container.format.name} stream has no time stamps: {stream.average_rate} "
            "frames per second were assumed"
        )
    channel = CHANNELS[TOPIC]
    schema = Schema(0, channel.schema, "ros2msg", definition(channel).encode())
    out = writer.stream(TOPIC, schema, metadata={"source": path.name})
    lost = count = 0
    for stamp, data in _pictures(container, stream):
        if stamp is None:
            lost += 1
            continue
        stamp_ns = start_ns + round(stamp * 1_000_000_000)
        out.put(max(stamp_ns, 0), encode_image(stamp_ns, "camera", "jpeg", data))
        count += 1
    if not count:
        raise ImportFailed(f"{path} holds no frame with a time stamp")
    report = Report(notes)
    if lost:
        report.losses.append(f"{lost} frames without a time stamp were left out")
    others = len(container.streams) - 1
    if others:
        notes.append(f"{others} other streams (sound, subtitles, more pictures) were left out")
    return report


def _start(container: Any, stream: Any) -> tuple[int, list[str]]:
    text = stream.metadata.get("creation_time") or container.metadata.get("creation_time")
    if text:
        try:
            moment = np.datetime64(text.rstrip("Z").replace(" ", "T"), "ns")
            return int(moment.astype(np.int64)), []
        except ValueError:
            pass
    return 0, ["the file does not say when it was recorded: its first frame is near 1970"]


def _pictures(container: Any, stream: Any) -> Any:
    """Presentation time (s, None if unknown) and JPEG of each frame."""
    import cv2

    base: Fraction = stream.time_base
    if stream.codec_context.name == "mjpeg":
        for packet in container.demux(stream):
            if packet.size:
                yield (None if packet.pts is None else packet.pts * base), bytes(packet)
        return
    for frame in container.decode(stream):
        image = frame.to_ndarray(format="bgr24")
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        yield (None if frame.pts is None else frame.pts * base), data.tobytes()
