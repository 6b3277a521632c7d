"""ULog files of PX4 flight controllers and of what is built on them, through pyulog."""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import HardwareError, ImportFailed

from .content import Content

_TIME = "timestamp"
_UTC = "time_utc_usec"
_PLAUSIBLE_UTC_US = (1_000_000_000_000_000, 4_000_000_000_000_000)
"""2001 to 2096; receivers without a fix tell 0 or some weeks after 1980."""
_LONGEST_US = 1_000_000_000_000_000


class ULogImporter:
    """Reads the topics of a `.ulg` file, their fields named `topic/field`, `topic/field[0]`.

    A topic logged several times is `topic_1`, `topic_2`. Times count from the boot of the
    controller; a receiver of satellite navigation in the log ties them to 1970.
    """

    def load(self, path: Path) -> Content:
        """All numeric fields; `ImportFailed` if the file is no ULog file."""
        try:
            from pyulog import ULog
        except ImportError as error:
            raise HardwareError(
                f"{path}: ULog files are read by pyulog: pip install 'seamlog[import]'"
            ) from error
        printed = StringIO()
        with path.open("rb") as file:
            try:
                with redirect_stdout(printed):
                    log = ULog(file)
            except (Exception, SystemExit) as error:  # pyulog leaves the program over some faults
                raise ImportFailed(f"{path} cannot be read as a ULog file: {error}") from error
        content = Content({}, notes=[*dict.fromkeys(printed.getvalue().splitlines())])
        content.losses = _losses(log)
        start_us = _start_us(log, content.notes)
        columns: dict[str, NDArray[Any]] = {}
        for data in log.data_list:
            _add(data, start_us, columns, content)
        if not columns:
            raise ImportFailed("; ".join([f"{path} has no topic with messages", *content.losses]))
        content.columns = columns
        others = len(log.initial_parameters), len(log.logged_messages)
        content.notes.append(f"{others[0]} parameters and {others[1]} texts were not imported")
        return content


def _losses(log: Any) -> list[str]:
    found = []
    if log.file_corruption:
        found.append("parts of the file are damaged and were passed over")
    if log.dropouts:
        lost_s = sum(dropout.duration for dropout in log.dropouts) * 1e-3
        found.append(
            f"the logger itself dropped data {len(log.dropouts)} times, {lost_s:.3g} s in all"
        )
    return found


def _start_us(log: Any, notes: list[str]) -> int:
    """Time of the boot, us since 1970; 0 where nothing in the log tells."""
    for data in log.data_list:
        utc, stamps = data.data.get(_UTC), data.data.get(_TIME)
        if utc is None or stamps is None:
            continue
        first, last = _PLAUSIBLE_UTC_US
        known = np.flatnonzero((utc > first) & (utc < last) & (stamps < _LONGEST_US))
        if len(known):
            notes.append(f"times are tied to 1970 by {data.name}")
            return int(utc[known[0]]) - int(stamps[known[0]])
    notes.append("no receiver tells the date: times count from the boot of the controller")
    return 0


def _add(data: Any, start_us: int, columns: dict[str, NDArray[Any]], content: Content) -> None:
    topic = data.name + (f"_{data.multi_id}" if data.multi_id else "")
    stamps = data.data.get(_TIME, np.empty(0))
    if not len(stamps):
        content.notes.append(f"topic {topic} has no messages with times")
        return
    if stamps.dtype.kind != "u" or stamps.max() > _LONGEST_US:
        content.losses.append(f"topic {topic} has damaged times and was left out")
        return
    time = f"{topic}/time"
    columns[time] = (stamps.astype(np.int64) + start_us) * 1000
    content.units[time] = "ns"
    for field, values in data.data.items():
        if field != _TIME and values.dtype.kind in "biuf":
            columns[f"{topic}/{field}"] = values
            content.times[f"{topic}/{field}"] = time
