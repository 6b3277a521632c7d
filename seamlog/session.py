"""Sessions: what was recorded, by topic, field and time.

    with seamlog.open_session("weld.mcap") as session:
        encoder = session.columns("/table/encoder")
        frame = session.frames().at(encoder["stamp_ns"][0])

Opening reads the summaries only. Whatever of a file cannot be read is said in `info.problems`,
which grows when damage is met later; nothing is left out silently.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from seamlog.channels import CHANNELS
from seamlog.errors import ChannelMissing, SessionError, UnknownName
from seamlog.limits import LIMITS, Limits
from seamlog.mcap.attachments import Attachments
from seamlog.mcap.columns import LOG_TIME, STAMP, Columns, by_log_time, is_in_order
from seamlog.mcap.decoders import TYPED
from seamlog.mcap.file import ENDLESS, McapFile
from seamlog.mcap.one_by_one import filled
from seamlog.mcap.records import ChannelRecord
from seamlog.migrate import FORMAT, format_of, migrated
from seamlog.segments import PROBLEMS, RECORDING, find_segments, grown_segments, is_live
from seamlog.session_info import ChannelInfo, SessionInfo, session_info
from seamlog.welds import Weld, welds_of

if TYPE_CHECKING:
    import pandas as pd

    from seamlog.frames import Frames

IMAGE_TOPIC = "/camera/image"
_EVENTS = CHANNELS["/events"]


def open_session(path: str | Path | Sequence[str | Path], limits: Limits = LIMITS) -> "Session":
    """Open a session by any of its files, the list of them, or their folder.

    Raises `FileNotFoundError`, or `SessionError` if it is empty, foreign or cut before its first
    chunk. Unfinished and damaged files open; `info.problems` says what is missing.
    """
    return Session(find_segments(path, limits), limits)


class Session:
    """One recording, or a window of it; close it or use it as a context manager."""

    def __init__(
        self, files: Sequence[McapFile], limits: Limits, window: tuple[int, int] = ENDLESS
    ) -> None:
        self.files, self.limits = tuple(files), limits
        self.span = window

    @property
    def path(self) -> Path:
        """The first file."""
        return self.files[0].path

    @property
    def paths(self) -> tuple[Path, ...]:
        """All files, in order."""
        return tuple(file.path for file in self.files)

    @cached_property
    def _topics(self) -> list[str]:
        rows = (row for file in self.files for row in file.index.channels.values())
        return sorted({row.topic for row in rows})

    @property
    def is_window(self) -> bool:
        """True for a window of a session."""
        return self.span != ENDLESS

    @cached_property
    def info(self) -> SessionInfo:
        """What there is: channels, welds, attachments, problems."""
        return session_info(self)

    @property
    def problems(self) -> list[str]:
        """What is missing or damaged, as far as it is known by now."""
        found = [text for file in self.files for text in file.problems]
        copied = self.metadata.get(PROBLEMS, {}).values()
        return list(dict.fromkeys([*found, *(f"in the session copied here: {t}" for t in copied)]))

    @cached_property
    def welds(self) -> list[Weld]:
        """Arc-on to arc-off, from `/events`, in log time; of a window those that touch it."""
        if self.is_window:
            start, end = self.span
            whole = Session(self.files, self.limits).welds
            return [weld for weld in whole if weld.start_ns < end and weld.end_ns > start]
        if self.schema(_EVENTS.topic) != _EVENTS.schema:
            return []
        events = self.columns(_EVENTS.topic, ["kind"])
        last = max((file.index.statistics.end_ns for file in self.files), default=0)
        welds, oddities = welds_of(events["kind"].tolist(), events[LOG_TIME].tolist(), last)
        for oddity in oddities:
            self.files[0].note(f"{self.path}: {oddity}")
        return welds

    def schema(self, topic: str) -> str | None:
        """Name of the topic's message; None if the topic is not there or has no schema."""
        for file in self.files:
            for row in file.channels(topic):
                schema = file.index.schemas.get(row.schema_id)
                return schema.name if schema else None
        return None

    def channel_metadata(self, topic: str) -> dict[str, str]:
        """Metadata of a topic's channel (the first one's values where several have a key)."""
        self.check_topic(topic)
        rows = [row for file in self.files for row in file.channels(topic)]
        return {key: value for row in reversed(rows) for key, value in row.metadata.items()}

    def check_topic(self, topic: str) -> None:
        """Raise `ChannelMissing` unless the session has a channel of this topic."""
        if topic not in self._topics:
            known = ", ".join(self._topics) or "none"
            raise ChannelMissing(f"{self.path} has no channel {topic}; there are: {known}")

    def columns(self, topic: str, fields: Sequence[str] | None = None) -> Columns:
        """Field name to array in the order of capture, which `log_time_ns` (int64) tells.

        Where the recorder's clock stepped back, order stays and `problems` says so.
        Nested fields have dotted names; fixed arrays are 2-D; strings and sequences are object
        arrays. `stamp_ns` (int64) is the time of the event where the messages carry one.
        `fields` picks some, `UnknownName` for others. Raises `ChannelMissing`.
        """
        self.check_topic(topic)
        rows = [(file, row) for file in self.files for row in file.channels(topic)]
        parts = [self._part(file, row, fields) for file, row in rows]
        jumbled = [place for place, part in enumerate(parts) if not is_in_order(part)]
        if len(parts) == 1 and not jumbled:
            return parts[0]
        if all(row.message_encoding not in TYPED for _, row in rows):
            parts = filled(parts)
        joined = _joined(parts, f"{self.path}: {topic}")
        kept = [rows[at][0].kept_order(rows[at][1], parts[at], self.span) for at in jumbled]
        return joined if any(kept) else by_log_time(joined)

    def _part(self, file: McapFile, row: ChannelRecord, fields: Sequence[str] | None) -> Columns:
        recording = next((values for name, values in file.metadata if name == RECORDING), {})
        version = format_of(recording, str(file.path))
        if version == FORMAT:
            return file.columns(row, fields, self.span)
        whole = migrated(row.topic, file.columns(row, None, self.span), version)
        wanted = (LOG_TIME, STAMP, *(whole if fields is None else fields))
        return {name: column for name, column in whole.items() if name in wanted}

    def table(self, topic: str) -> "pd.DataFrame":
        """`columns` as a table; an array `values` of n gives columns `values[0]` and so on."""
        import pandas as pd

        flat: dict[str, Any] = {}
        for name, column in self.columns(topic).items():
            if column.ndim == 1:
                flat[name] = column
            else:
                flat |= {f"{name}[{place}]": column[:, place] for place in range(column.shape[1])}
        return pd.DataFrame(flat)

    def frames(self, topic: str = IMAGE_TOPIC) -> "Frames":
        """The pictures of a topic, read one by one when asked for."""
        from seamlog.frames import Frames

        self.check_topic(topic)
        return Frames(self, topic)

    def window(self, start_ns: int, end_ns: int) -> "Session":
        """The messages with log times in `[start_ns, end_ns)`; shares the open files."""
        start, end = max(start_ns, self.span[0]), min(end_ns, self.span[1])
        return Session(self.files, self.limits, (start, max(start, end)))

    def weld(self, number: int) -> "Session":
        """The window of weld `number`, counted from 1; `UnknownName` if there is none."""
        for weld in self.welds:
            if weld.number == number:
                return self.window(weld.start_ns, weld.end_ns)
        raise UnknownName(f"{self.path} has no weld {number}; it has {len(self.welds)}")

    @cached_property
    def attachments(self) -> Attachments:
        """Files in the session by name, read and checked when asked for."""
        return Attachments([(f.source, f.index.attachments) for f in self.files], self.limits)

    @cached_property
    def metadata(self) -> Mapping[str, dict[str, str]]:
        """Metadata records by name; of two with one name the later one counts."""
        return {name: values for file in self.files for name, values in file.metadata}

    def grow(self) -> bool:
        """Take in what was recorded meanwhile, in its last file and in new ones; False if nothing.

        Columns and windows of before stay as they were; `files` are opened anew where they grew.
        """
        found = grown_segments(self.files, self.limits)
        if found is None:
            return False
        self.files = tuple(found)
        for name in [*vars(self)]:
            if isinstance(getattr(type(self), name, None), cached_property):
                delattr(self, name)
        return True

    @property
    def is_being_recorded(self) -> bool:
        """The recorder, or the loop that it belongs to, is at work on this machine."""
        return is_live(self.metadata.get(RECORDING, {}).get("ring_path", ""))

    def close(self) -> None:
        """Close the files; windows of this session end with it."""
        for file in self.files:
            file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _joined(parts: list[Columns], where: str) -> Columns:
    if len(parts) == 1:
        return parts[0]
    filled = [part for part in parts if len(part[LOG_TIME])] or parts[:1]
    names = filled[0].keys()
    if any(part.keys() != names for part in filled):
        raise SessionError(f"{where} has different fields in different files; open them one by one")
    return {name: np.concatenate([part[name] for part in filled]) for name in names}


__all__ = ["ChannelInfo", "Session", "SessionInfo", "Weld", "open_session"]
