"""Columns of a channel whose messages are JSON objects, in files of others."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap.columns import LOG_TIME, Columns
from seamlog.mcap.records import Malformed
from seamlog.mcap.rows import PAYLOAD, Batch


def json_columns(batches: Iterable[Batch]) -> Columns:
    """Field name (dotted where nested) to column; numbers as arrays, everything else as objects.

    A number that a message lacks is NaN, another value None.
    """
    times: list[int] = []
    documents: list[dict[str, Any]] = []
    for batch in batches:
        found = sorted(_decoded(batch), key=lambda item: item[0])
        times += [time for _, time, _ in found]
        documents += [document for _, _, document in found]
    names = dict.fromkeys(name for document in documents for name in document)
    columns = {name: _column([row.get(name) for row in documents]) for name in names}
    return {LOG_TIME: np.array(times, np.int64)} | columns


def _decoded(batch: Batch) -> list[tuple[int, int, dict[str, Any]]]:
    found = []
    for rows, places in batch.groups:
        order = range(rows.count) if places is None else places.tolist()
        payloads = rows.column(0, "u1", rows.length - PAYLOAD)
        for place, time, payload in zip(order, rows.log_times_ns().tolist(), payloads, strict=True):
            found.append((place, time, _flat(_parsed(payload.tobytes()), "")))
    return found


def _parsed(payload: bytes) -> dict[str, Any]:
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"a message is no JSON: {error}") from error
    if not isinstance(document, dict):
        raise Malformed("a message is JSON but no object")
    return document


def _flat(document: dict[str, Any], prefix: str) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in document.items():
        if isinstance(value, dict):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat


def _column(values: list[Any]) -> NDArray[Any]:
    kinds = {type(value) for value in values}
    if kinds == {int} and all(-(1 << 63) <= value < 1 << 63 for value in values):
        return np.array(values, np.int64)
    if kinds == {bool}:
        return np.array(values, np.bool_)
    if kinds <= {int, float, type(None)} and kinds != {type(None)}:
        return np.array([np.nan if value is None else value for value in values], np.float64)
    array = np.empty(len(values), object)
    for place, value in enumerate(values):
        array[place] = value
    return array
