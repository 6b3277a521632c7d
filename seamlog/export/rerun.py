"""Topics as a Rerun recording (`.rrd`)."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import IMAGE_SCHEMA
from seamlog.errors import FrameMissing, HardwareError, ImageError
from seamlog.files import replacing
from seamlog.frames import Frame
from seamlog.mcap.columns import LOG_TIME, STAMP
from seamlog.pictures import picture_header
from seamlog.session import Session

from .parts import as_text, iter_parts

_PICTURE_BYTES = 32 << 20


def write_rerun(session: Session, topics: list[str], path: Path, force: bool) -> int:
    """Numbers as scalars, texts as log lines, pictures as they are; number of values written.

    The entity of a field is its topic and its name, its timelines are `stamp` and `log_time`.
    Whole numbers of 64 bits come as components `int64` or `uint64` too, since scalars are float64;
    what is neither number nor text comes as JSON.
    """
    try:
        import rerun
    except ImportError as error:
        raise HardwareError(
            "Rerun files are written by rerun-sdk: pip install 'seamlog[view]'"
        ) from error
    name = session.info.recording_id or session.path.stem
    with replacing(path, force) as partial:
        recording = rerun.RecordingStream("seamlog", recording_id=name)
        recording.save(partial)
        count = sum(_write(rerun, recording, session, topic) for topic in topics)
        recording.flush()
        recording.disconnect()
    return count


def _write(rerun: Any, recording: Any, session: Session, topic: str) -> int:
    entity = topic.strip("/").split("/")
    count = 0
    if session.schema(topic) == IMAGE_SCHEMA:
        for frames in _batches(session, topic):
            made = rerun.EncodedImage.columns(
                blob=[frame.data for frame in frames],
                media_type=[_media_type(frame) for frame in frames],
            )
            stamps = np.array([frame.stamp_ns for frame in frames], np.int64)
            log_times = np.array([frame.log_time_ns for frame in frames], np.int64)
            _send(rerun, recording, entity, stamps, log_times, made)
            count += len(frames)
        return count
    for columns in iter_parts(session, topic):
        log_times = columns.pop(LOG_TIME)
        stamps = columns.pop(STAMP, log_times)
        for name, column in columns.items():
            for part, values in _flat(name, column):
                made = _components(rerun, values)
                _send(rerun, recording, [*entity, part], stamps, log_times, made)
                count += len(values)
    return count


def _send(
    rerun: Any,
    recording: Any,
    entity: list[str],
    stamps: NDArray[np.int64],
    log_times: NDArray[np.int64],
    made: Any,
) -> None:
    """Strict: Rerun would else warn and go on without the values."""
    if len(log_times):
        index = [
            rerun.TimeColumn("stamp", timestamp=stamps.astype("datetime64[ns]")),
            rerun.TimeColumn("log_time", timestamp=log_times.astype("datetime64[ns]")),
        ]
        recording.send_columns(rerun.new_entity_path(entity), index, made, strict=True)


def _flat(name: str, column: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    if column.ndim == 1:
        yield name, column
        return
    for place in range(column.shape[1]):
        yield f"{name}[{place}]", column[:, place]


def _components(rerun: Any, values: NDArray[Any]) -> list[Any]:
    """Components of one column; sequences of numbers have one partition each."""
    if values.dtype != object:
        return _numbers(rerun, values)
    if len(values) and all(isinstance(value, np.ndarray) and value.ndim == 1 for value in values):
        flat = np.concatenate(list(values))
        if flat.dtype.kind in "biuf":
            sizes = [len(value) for value in values]
            return [made.partition(sizes) for made in _numbers(rerun, flat)]
    return [*rerun.TextLog.columns(text=[as_text(value) for value in values])]


def _numbers(rerun: Any, values: NDArray[Any]) -> list[Any]:
    """As scalars; whole numbers of 64 bits also as they are, which float64 may not hold."""
    import pyarrow as pa

    made = [*rerun.Scalars.columns(scalars=values.astype(np.float64))]
    if values.dtype.kind in "iu" and values.itemsize == 8:
        exact = pa.array(np.ascontiguousarray(values))
        made += rerun.AnyValues.columns(**{values.dtype.name: exact})
    return made


def _batches(session: Session, topic: str) -> Iterator[list[Frame]]:
    """Pictures of bounded size at once, without damaged ones, which the session notes."""
    frames = session.frames(topic)
    batch: list[Frame] = []
    for place in range(len(frames)):
        try:
            batch.append(frames[place])
        except FrameMissing:
            continue
        if sum(len(frame.data) for frame in batch) > _PICTURE_BYTES:
            yield batch
            batch = []
    if batch:
        yield batch


def _media_type(frame: Frame) -> str:
    try:
        return picture_header(frame.data, frame.where).media_type
    except ImageError:
        return f"image/{frame.format}"
