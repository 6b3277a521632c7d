"""Values of one protobuf message by column name, through the `protobuf` package."""

from collections.abc import Collection
from typing import Any

import numpy as np

from seamlog.mcap.protobuf_fields import Field, column_forms, parsed, to_dict


def decode_message(
    kind: Any, fields: dict[int, Field], data: bytes, names: Collection[str]
) -> dict[str, Any]:
    """Value of each column of `names`; `Malformed` if the bytes are no such message."""
    found = _values(parsed(kind, data), fields, "")
    return {name: found[name] for name in names}


def _values(message: Any, fields: dict[int, Field], prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for field in fields.values():
        value, name = getattr(message, field.name), prefix + field.name
        if field.fields is None:
            found[name] = _value(field, value)
        elif field.is_repeated:
            found |= _series(field, value, name + ".")
        else:
            found |= _values(value, field.fields, name + ".")
    return found


def _series(field: Field, value: Any, prefix: str) -> dict[str, Any]:
    """Of a repeated message: an array (a list, of objects) for each of its fields."""
    assert field.fields is not None
    if hasattr(value, "items"):
        entry = field.kind_of_entry
        items = [entry(key=key, value=item) for key, item in value.items()]
    else:
        items = list(value)
    rows = [_values(item, field.fields, prefix) for item in items]
    found: dict[str, Any] = {}
    for name, form in column_forms(field.fields, prefix):
        values = [row[name] for row in rows]
        found[name] = values if form.dtype is object else np.array(values, form.dtype)
    return found


def _value(field: Field, value: Any) -> Any:
    if field.recursive is not None:
        items = value if field.is_repeated else [value]
        made = [to_dict(field.recursive, item.SerializeToString()) for item in items]
        return made if field.is_repeated else made[0]
    if not field.is_repeated:
        return value
    return list(value) if field.form is object else np.array(value, field.form)
