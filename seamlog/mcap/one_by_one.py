"""Columns of messages that are decoded one after the other: JSON, and decoders of others."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import PluginFailed, SeamlogError
from seamlog.limits import Limits
from seamlog.mcap.columns import LOG_TIME, Columns, check_size
from seamlog.mcap.records import Malformed
from seamlog.mcap.rows import Batch
from seamlog.mcap.shapes import objects

DecodeOne = Callable[[bytes], Any]


def columns_one_by_one(batches: Iterable[Batch], decode: DecodeOne, limits: Limits) -> Columns:
    """Field name (dotted where nested) to column; numbers as arrays, everything else as objects.

    A number that a message lacks is NaN, another value None.
    """
    times: list[int] = []
    documents: list[dict[str, Any]] = []
    for batch in batches:
        check_size(int(batch.places()[1].max(initial=0)), limits)
        for time, payload in batch.payloads():
            times.append(time)
            documents.append(_flat(_attempt(decode, bytes(payload)), "", 0))
    names = dict.fromkeys(name for document in documents for name in document)
    columns = {name: _column([row.get(name) for row in documents]) for name in names}
    return {LOG_TIME: np.array(times, np.int64)} | columns


def decode_json(payload: bytes) -> dict[str, Any]:
    """A message that is a JSON object; `Malformed` otherwise."""
    try:
        document = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"a message is no JSON: {error}") from error
    if not isinstance(document, dict):
        raise Malformed("a message is JSON but no object")
    return document


def _attempt(decode: DecodeOne, payload: bytes) -> Any:
    try:
        return decode(payload)
    except (SeamlogError, Malformed):
        raise
    except Exception as error:
        name = getattr(decode, "__qualname__", type(decode).__name__)
        raise PluginFailed(f"the decoder {name} raised {type(error).__name__}: {error}") from error


def _flat(message: Any, prefix: str, depth: int) -> dict[str, Any]:
    """Leaves of a message that is a mapping or an object with fields, by dotted name."""
    flat: dict[str, Any] = {}
    for key, value in _fields(message).items():
        if depth < 32 and _fields(value):
            flat |= _flat(value, f"{prefix}{key}.", depth + 1)
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def _fields(message: Any) -> Mapping[str, Any]:
    if isinstance(message, Mapping):
        return message
    if isinstance(message, str | bytes | int | float | list | tuple | np.ndarray | None):
        return {}
    names = getattr(message, "__slots__", None) or getattr(message, "__dict__", {})
    return {name: getattr(message, name) for name in names if not name.startswith("_")}


def _column(values: list[Any]) -> NDArray[Any]:
    kinds = {type(value) for value in values}
    if kinds == {int} and all(-(1 << 63) <= value < 1 << 63 for value in values):
        return np.array(values, np.int64)
    if kinds == {bool}:
        return np.array(values, np.bool_)
    if kinds <= {int, float, type(None)} and kinds != {type(None)}:
        try:
            return np.array([np.nan if value is None else value for value in values], np.float64)
        except OverflowError:
            return objects(values)
    return objects(values)


def filled(parts: Sequence[Columns]) -> list[Columns]:
    """Parts of one topic with the same columns: what one lacks is NaN, or None."""
    names = list(dict.fromkeys(name for part in parts for name in part))
    kinds = {name: {part[name].dtype.kind for part in parts if name in part} for name in names}
    found = []
    for part in parts:
        count = len(part[LOG_TIME])
        lacking = {
            name: np.full(count, np.nan) if kinds[name] <= set("iuf") else np.full(count, None)
            for name in names
            if name not in part
        }
        found.append({name: (part | lacking)[name] for name in names})
    return found
