"""Writes the `put` of a fixed-width topic as source, so that a call costs as little as it can.

As in `dataclasses`, one text is filled in per topic: packing by named parameters saves building
and unpacking a tuple, a fifth of the whole call. Only names of the channel table enter the text.

`number`, the count of accepted messages, is the whole state of the ring: no exception and no
interrupt between two instructions can leave it inconsistent. A handler of a signal may put too: it
runs behind a call only, so that `number` tells whether the slot just packed was taken meanwhile.
"""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NoReturn, TypeAlias

from seamlog.messages import CDR_HEADER_INT, PRIMITIVES, Layout, split_array

from .ring import HEAD

Put: TypeAlias = Callable[..., bool]
PutNamed: TypeAlias = Callable[[int, Mapping[str, Any]], bool]
"""From stamp and fields by name; `TypeError` for fields that are not the topic's."""
Stop: TypeAlias = Callable[[], None]

_SEQUENCES = 1 << 32
_SOURCE = """
def make(pack_into, data, words, slots, stride, now, anchor, owner, gate):
    number, gaps, limit = 0, 0, slots

    def put(stamp_ns=MISSING, {parameters}, *rest):
        nonlocal number, gaps, limit
        if get_ident() != owner:
            return gate.refuse_foreign()
        place = number
        try:
            log_time = now() + anchor
        except Exception as error:
            return gate.refuse_values((stamp_ns, {names}), error)
        if rest or number >= limit or number != place:
            if rest:
                return gate.refuse_values((stamp_ns, {names}, *rest), "too many values")
            limit = gate.new_limit(number)
            if not gate.is_open:
                limit = -1
                return gate.refuse_closed()
            if number != place:
                return put(stamp_ns, {names})
            if number >= limit:
                gaps += 1
                return gate.drop(number + gaps - 1)
        try:
            pack_into(
                data, place % slots * stride, place + gaps, log_time, stamp_ns,
                {cdr_header}, stamp_ns, {packed}
            )
        except Exception as error:
            if number + gaps >= {sequences}:
                gaps -= {sequences}
                return put(stamp_ns, {names})
            return gate.refuse_values((stamp_ns, {names}), error)
        if number != place:
            return put(stamp_ns, {names})
        number = place + 1
        words[{head}] = number
        return True

    def put_named(stamp_ns, fields):
        nonlocal number
        if len(fields) != {count} or get_ident() != owner:
            return put(stamp_ns, **fields)
        place = number
        try:
            log_time = now() + anchor
        except Exception:
            return put(stamp_ns, **fields)
        if number >= limit or number != place:
            return put(stamp_ns, **fields)
        try:
            pack_into(
                data, place % slots * stride, place + gaps, log_time, stamp_ns,
                {cdr_header}, stamp_ns, {packed_by_name}
            )
        except Exception:
            return put(stamp_ns, **fields)
        if number != place:
            return put(stamp_ns, **fields)
        number = place + 1
        words[{head}] = number
        return True

    def stop():
        nonlocal limit
        limit = -1

    return put, put_named, stop
"""


class _Missing:
    """Stands for a value that was not given; no field takes it."""

    def __repr__(self) -> str:
        return "missing"

    def __bool__(self) -> NoReturn:
        raise TypeError("a value is missing")


def parameter_names(layout: Layout) -> list[str]:
    """Values of a message behind its stamp, arrays element by element."""
    names = []
    for name, kind in zip(layout.names[1:], layout.kinds[1:], strict=True):
        count = split_array(kind)[1]
        names += [name] if count is None else [f"{name}_{i}" for i in range(count)]
    return names


@cache
def put_maker(layout: Layout) -> Callable[..., tuple[Put, PutNamed, Stop]]:
    """The function that makes both ways to put, and what ends them, over one ring."""
    from threading import get_ident

    names = parameter_names(layout)
    kinds = dict(zip(layout.names, layout.kinds, strict=True))
    text = _SOURCE.format(
        parameters=", ".join(f"{name}=MISSING" for name in names),
        names=", ".join(names),
        count=len(names),
        packed=", ".join(_packed(name, kinds.get(name, "")) for name in names),
        packed_by_name=", ".join(
            _packed(f"fields[{name!r}]", kinds.get(name, "")) for name in names
        ),
        cdr_header=CDR_HEADER_INT,
        sequences=_SEQUENCES,
        head=HEAD,
    )
    space: dict[str, Any] = {
        "get_ident": get_ident,
        "MISSING": _Missing(),
        "BOOLS": {False: False, True: True},
    }
    exec(text, space)
    found: Callable[..., tuple[Put, PutNamed, Stop]] = space["make"]
    return found


def _packed(name: str, kind: str) -> str:
    """`struct` takes anything for a bool; a table of the two takes nothing else."""
    return f"BOOLS[{name}]" if PRIMITIVES.get(kind) == "?" else name
