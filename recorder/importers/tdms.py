"""TDMS files of LabVIEW, through npTDMS."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import HardwareError, ImportFailed

from .content import Content


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
        try:
            file = TdmsFile.read(path)
        except Exception as error:
            raise ImportFailed(f"{path} cannot be read as a TDMS file: {error}") from error
        content = Content({}, notes=[])
        columns: dict[str, NDArray[Any]] = {}
        for group in file.groups():
            for channel in group.channels():
                _add(f"{group.name}/{channel.name}", channel, columns, content)
        if not columns:
            raise ImportFailed(f"{path} has no channel of numbers")
        content.columns = columns
        return content


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
    times = _times(name, channel, len(values), content.notes)
    if times is None:
        return
    for other, column in columns.items():
        if other.endswith(" time") and np.array_equal(column, times):
            content.times[name] = other
            return
    content.times[name] = f"{name} time"
    columns[f"{name} time"] = times
    content.units[f"{name} time"] = "ns"


def _times(name: str, channel: Any, count: int, notes: list[str]) -> NDArray[np.int64] | None:
    properties = channel.properties
    step = properties.get("wf_increment")
    if not isinstance(step, int | float) or not step > 0:
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
