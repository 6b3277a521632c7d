"""Topics as a Rerun recording (`.rrd`)."""

from pathlib import Path
from typing import Any

import numpy as np

from seamlog.channels import IMAGE_SCHEMA
from seamlog.errors import FrameMissing, HardwareError
from seamlog.files import replacing
from seamlog.session import Session


def write_rerun(session: Session, topics: list[str], path: Path, force: bool) -> int:
    """Numbers as scalars, texts as log lines, pictures as they are; number of values written."""
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
    if session.schema(topic) == IMAGE_SCHEMA:
        return _write_pictures(rerun, recording, session, topic)
    columns = session.columns(topic)
    log_times = columns.pop("log_time_ns")
    stamps = columns.pop("stamp_ns", log_times)
    index = [
        rerun.TimeColumn("stamp", timestamp=stamps.astype("datetime64[ns]")),
        rerun.TimeColumn("log_time", timestamp=log_times.astype("datetime64[ns]")),
    ]
    count = 0
    for name, column in columns.items():
        parts = {name: column}
        if column.ndim == 2:
            parts = {f"{name}[{place}]": column[:, place] for place in range(column.shape[1])}
        for part, values in parts.items():
            entity = f"{topic.strip('/')}/{part}"
            if values.dtype.kind in "biuf":
                made = rerun.Scalars.columns(scalars=values.astype(np.float64))
            elif len(values) and isinstance(values[0], str):
                made = rerun.TextLog.columns(text=list(values))
            else:
                continue
            recording.send_columns(entity, indexes=index, columns=made)
            count += len(values)
    return count


def _write_pictures(rerun: Any, recording: Any, session: Session, topic: str) -> int:
    count, frames = 0, session.frames(topic)
    for place in range(len(frames)):
        try:
            frame = frames[place]
        except FrameMissing:
            continue
        recording.set_time("stamp", timestamp=np.datetime64(frame.stamp_ns, "ns"))
        recording.set_time("log_time", timestamp=np.datetime64(frame.log_time_ns, "ns"))
        media = f"image/{frame.format if frame.format in ('png', 'jpeg') else 'jpeg'}"
        image = rerun.EncodedImage(contents=frame.data, media_type=media)
        recording.log(topic.strip("/"), image)
        count += 1
    return count
