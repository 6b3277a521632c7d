"""TDMS files of LabVIEW, through npTDMS."""

import logging
import re
from collections.abc import Iterator
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import HardwareError, ImportFailed

from .content import Content

_START = re.compile(rb"\x0d\0\0\0wf_start_time\x44\0\0\0(.{16})", re.DOTALL)
"""A start of a waveform as it stands in the file: name, type, time stamp."""
_SECONDS = ("", "s", "sec", "second", "seconds")


class TdmsImporter:
    """Reads the channels of a `.tdms` file, named `group/channel`.

    Waveforms bring their time: start, offset and increment become a column
    `group/channel time` in ns since 1970 (UTC). Time stamps become ns, units are taken over.
    """

    def load(self, path: Path) -> Content:
        """All numeric channels; `ImportFailed` if the file is no TDMS file."""
        try:
            from nptdms import TdmsFile
        except ImportError as error:
            raise HardwareError(
                f"{path}: TDMS files are read by npTDMS: pip install 'seamlog[import]'"
            ) from error
        for module in ("reader", "tdms_segment"):  # what they warn of is said below
            logging.getLogger(f"nptdms.{module}").setLevel(logging.ERROR)
        try:
            file = TdmsFile.read(path)
        except Exception as error:
            raise ImportFailed(f"{path} cannot be read as a TDMS file: {error}") from error
        if not path.stat().st_size:
            raise ImportFailed(f"{path} is empty")
        content = Content({}, notes=[], losses=[*_cut(file)])
        starts = _starts(path)
        columns: dict[str, NDArray[Any]] = {}
        for group in file.groups():
            for channel in group.channels():
                _add(f"{group.name}/{channel.name}", channel, columns, content)
        if not file.groups():
            raise ImportFailed(f"{path} holds no group of channels; it may be cut within its head")
        if not columns:
            why = "; ".join([*content.losses, *content.notes])
            raise ImportFailed(f"{path} has no channel of numbers" + (f": {why}" if why else ""))
        _add_times(file, columns, content, starts)
        content.columns = columns
        return content


def _cut(file: Any) -> Iterator[str]:
    """What is missing of a file that was not closed."""
    for path, status in (file.file_status.channel_statuses or {}).items():
        lost = status.expected_length - status.read_length
        if lost > 0:
            yield f"the file is cut: the last {lost} values of channel {path} are missing"


def _starts(path: Path) -> int:
    """How many different starts of waveforms the file holds; npTDMS tells only the last ones."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        return len(set(_START.findall(data)))


def _add(name: str, channel: Any, columns: dict[str, NDArray[Any]], content: Content) -> None:
    if not len(channel):
        content.notes.append(f"channel {name} is empty")
        return
    values = np.asarray(channel[:])
    if values.dtype.kind == "M":
        values = values.astype("datetime64[ns]").view(np.int64)
        content.units[name] = "ns"
    if values.dtype.kind not in "biuf" or values.ndim != 1:
        content.notes.append(f"channel {name} holds {values.dtype}, no numbers, and was left out")
        return
    columns[name] = values
    unit = channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription")
    if unit:
        content.units[name] = str(unit)


def _add_times(file: Any, columns: dict[str, NDArray[Any]], content: Content, starts: int) -> None:
    """Time columns of waveforms, one for all that have the same."""
    channels = {f"{g.name}/{c.name}": c for g in file.groups() for c in g.channels()}
    told = {c.properties.get("wf_start_time") for c in channels.values()} - {None}
    if starts > max(len(told), 1):
        content.notes.append(
            "the start of a waveform changes within the file: it states no times that can be "
            "trusted; give [time] with rate_hz and start"
        )
        return
    added: dict[str, NDArray[np.int64]] = {}
    for name in [name for name in columns if name in channels]:
        times = _times(name, channels[name], len(columns[name]), content.notes)
        if times is None:
            continue
        same = (other for other, column in added.items() if np.array_equal(column, times))
        label = next(same, f"{name} time")
        while label not in added and label in columns:
            label += " of waveform"
        added[label] = times
        content.times[name] = label
        content.units[label] = "ns"
    columns |= added


def _times(name: str, channel: Any, count: int, notes: list[str]) -> NDArray[np.int64] | None:
    properties = channel.properties
    step = properties.get("wf_increment")
    if not isinstance(step, int | float) or not step > 0:
        return None
    unit = str(properties.get("wf_xunit_string", "")).strip()
    if unit.lower() not in _SECONDS:
        notes.append(f"channel {name} is over {unit}, not over time")
        return None
    start = properties.get("wf_start_time")
    start_ns = 0
    if isinstance(start, np.datetime64):
        start_ns = int(start.astype("datetime64[ns]").view(np.int64))
    if start_ns <= 0:
        # LabVIEW writes 1904 where nobody set a start
        notes.append(f"channel {name} does not say when it began: its time counts from 1970")
        start_ns = 0
    start_ns += round(float(properties.get("wf_start_offset", 0.0)) * 1e9)
    if start_ns + count * step * 1e9 >= 2**63:
        return None
    steps: NDArray[np.int64] = np.rint(np.arange(count) * (step * 1e9)).astype(np.int64)
    return start_ns + steps
