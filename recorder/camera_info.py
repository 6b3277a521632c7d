"""The message of `/camera/info`: sensor_msgs/msg/CameraInfo."""

from collections.abc import Sequence

from seamlog.messages import CdrWriter

_TAIL = (("uint32", 0), ("uint32", 0)) + (("uint32", 0),) * 4 + (("bool", False),)
"""No binning, no region of interest."""


def encode_camera_info(
    stamp_ns: int,
    frame_id: str,
    height_px: int,
    width_px: int,
    distortion_model: str,
    distortion: Sequence[float],
    intrinsic: Sequence[float],
    rectification: Sequence[float],
    projection: Sequence[float],
) -> bytes:
    """CDR payload; `intrinsic` and `rectification` are 3 x 3, `projection` 3 x 4, row by row."""
    writer = CdrWriter()
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    fields = (
        ("int32", seconds),
        ("uint32", nanoseconds),
        ("string", frame_id),
        ("uint32", height_px),
        ("uint32", width_px),
        ("string", distortion_model),
        ("float64[]", distortion),
        ("float64[9]", intrinsic),
        ("float64[9]", rectification),
        ("float64[12]", projection),
        *_TAIL,
    )
    for kind, value in fields:
        writer.put(kind, value)
    return writer.payload()
