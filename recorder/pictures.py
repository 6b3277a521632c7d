"""From a raw picture in the ring to a CompressedImage message, in the recorder process."""

from functools import partial

import numpy as np

from seamlog.mcap.records import Buffer
from seamlog.messages import image_head

from .ring import MESSAGE, RECORD, RECORD_HEAD_BYTES
from .varying import RAW_HEAD
from .varying_feed import Encode

FRAME_ID = "camera"
JPEG_QUALITY = 90


def picture_payload(
    stamp_ns: int, frame_id: str, image_format: str, data: Buffer
) -> tuple[bytes, Buffer]:
    """CDR payload of a sensor_msgs/msg/CompressedImage in two parts, `data` not copied."""
    body = memoryview(data).cast("B")
    return image_head(stamp_ns, frame_id, image_format, len(body)), body


def load_encoder() -> None:
    """Load OpenCV, which takes tenths of a second, while nothing waits to be written."""
    import cv2

    cv2.setNumThreads(1)


def picture_encoder(channel_id: int) -> Encode:
    """A function from a raw record of the ring to a Message record of channel `channel_id`."""
    load_encoder()
    return partial(_encode, channel_id)


def _encode(channel_id: int, raw: memoryview) -> bytes:
    import cv2

    _, _, sequence, log_time_ns, stamp_ns, rows, columns, samples = RAW_HEAD.unpack_from(raw)
    shape = (rows, columns) if samples == 1 else (rows, columns, samples)
    image = np.frombuffer(raw, np.uint8, rows * columns * samples, RAW_HEAD.size).reshape(shape)
    done, jpeg = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
    if not done:
        raise ValueError("OpenCV made no JPEG of it")
    payload = picture_payload(stamp_ns, FRAME_ID, "jpeg", jpeg.data)
    return message_record(channel_id, sequence, log_time_ns, stamp_ns, *payload)


def message_record(
    channel_id: int, sequence: int, log_time_ns: int, publish_time_ns: int, *payload: Buffer
) -> bytes:
    """A whole MCAP Message record; the payload may come in parts."""
    length = RECORD.size - RECORD_HEAD_BYTES + sum(len(part) for part in payload)
    head = RECORD.pack(MESSAGE, length, channel_id, sequence, log_time_ns, publish_time_ns)
    return b"".join((head, *payload))
