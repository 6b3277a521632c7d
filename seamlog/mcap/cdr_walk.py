"""Decodes many CDR messages at once, field by field, whatever lengths their parts have.

Each message has a cursor; all cursors step over one field together. Slower than shapes, yet far
faster than one message after the other, and indifferent to how varied the messages are.
"""

import struct
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.mcap.records import Malformed
from seamlog.mcap.ros2msg import SEQUENCE, Node
from seamlog.mcap.rows import taken
from seamlog.mcap.shapes import Form, empty_of, objects, texts
from seamlog.messages import PRIMITIVES

if TYPE_CHECKING:
    from seamlog.mcap.cdr import Dialect

Integers = NDArray[np.int64]
_PADDING = 7


@dataclass(slots=True)
class Cursors:
    """Where each message is read next; offsets are bytes in `data`."""

    data: NDArray[np.uint8]
    start: Integers
    """Where alignment is counted from."""
    at: Integers
    end: Integers
    order: str
    dialect: "Dialect"
    texts: list[str] = field(default_factory=list)
    """What `text` found, shared by all parts."""

    def __len__(self) -> int:
        return len(self.at)

    def part(self, chosen: Integers) -> "Cursors":
        """The cursors of some messages, as copies."""
        moved = (self.start[chosen], self.at[chosen], self.end[chosen])
        return Cursors(self.data, *moved, self.order, self.dialect, self.texts)

    def text(self) -> str:
        """All data, taken for Latin-1."""
        if not self.texts:
            self.texts.append(str(self.data.data, "latin-1"))
        return self.texts[0]

    def align(self, width: int) -> None:
        """Step to a multiple of `width`."""
        if self.dialect.aligned:
            self.at = self.at + (self.start - self.at) % width

    def step(self, sizes: Integers | int) -> Integers:
        """Step over `sizes` bytes; where each began."""
        begun = self.at
        self.at = begun + sizes
        beyond = np.flatnonzero(self.at > self.end)
        if len(beyond):
            worst = beyond[0]
            raise Malformed(
                f"a field at byte {begun[worst]} of the chunk leaves its message, which ends at "
                f"byte {self.end[worst]}"
            )
        return begun

    def numbers(self, form: str, width: int) -> NDArray[Any]:
        """One number of each message."""
        self.align(width)
        begun = self.step(width)
        return taken(self.data, begun, form)

    def counts(self) -> Integers:
        """The next count of each message, a plausible one."""
        found = self.numbers(self.order + "u4", 4).astype(np.int64)
        if (found > self.end - self.at).any():
            raise Malformed(f"a count of {int(found.max())} elements is more than its message has")
        return found


def decode(
    nodes: Sequence[Node], cursors: Cursors, names: Collection[str]
) -> dict[str, NDArray[Any]]:
    """Columns of the messages under `cursors`, those of `names` only."""
    found: dict[str, NDArray[Any]] = {}
    _walk(nodes, cursors, "", names, found)
    if ((cursors.end - cursors.at) > _PADDING).any():
        raise Malformed("a message goes on behind the last field of its definition")
    return found


def _walk(
    nodes: Sequence[Node],
    cursors: Cursors,
    prefix: str,
    names: Collection[str],
    found: dict[str, NDArray[Any]],
) -> None:
    for node in nodes:
        name = prefix + node.name
        if node.fields is not None and node.count is None:
            _walk(node.fields, cursors, name + ".", names, found)
        elif node.fields is not None:
            _records(node, cursors, name, names, found)
        else:
            read = _texts if node.base == "string" else _numbers
            column = read(node, cursors, name in names)
            if column is not None:
                found[name] = column


def _numbers(node: Node, cursors: Cursors, wanted: bool) -> NDArray[Any] | None:
    code = PRIMITIVES[node.base]
    width = struct.calcsize("<" + code)
    form = "u1" if code == "?" else np.dtype(cursors.order + code).str
    if node.count is None:
        values = cursors.numbers(form, width)
        return _typed(values, code) if wanted else None
    if node.count != SEQUENCE:
        cursors.align(width)
        begun = cursors.step(width * node.count)
        windows = np.lib.stride_tricks.sliding_window_view(cursors.data, width * node.count)
        return _typed(windows[begun].view(form), code) if wanted and len(begun) else None
    counts = cursors.counts()
    filled = np.flatnonzero(counts)
    part = cursors.part(filled)
    part.align(width)
    cursors.at[filled] = part.at
    begun = cursors.step(counts * width)
    if not wanted:
        return None
    kind = np.dtype(form)
    rows = zip(begun.tolist(), counts.tolist(), strict=True)
    return objects(
        [_typed(np.frombuffer(cursors.data, kind, n, at), code).copy() for at, n in rows]
    )


def _typed(values: NDArray[Any], code: str) -> NDArray[Any]:
    return values != 0 if code == "?" else values.astype(values.dtype.newbyteorder("="))


def _texts(node: Node, cursors: Cursors, wanted: bool) -> NDArray[Any] | None:
    if node.count is None:
        return _one_text(cursors, wanted)
    each = _each(node, cursors, lambda part: {"": _one_text(part, wanted)})
    return objects(each[""]) if wanted else None


def _one_text(cursors: Cursors, wanted: bool) -> NDArray[Any] | None:
    sizes = cursors.counts()
    begun = cursors.step(sizes)
    if not wanted:
        return None
    ends = begun + np.maximum(sizes - cursors.dialect.terminator, 0)
    return texts(cursors.text(), begun.tolist(), ends.tolist())


def _records(
    node: Node,
    cursors: Cursors,
    name: str,
    names: Collection[str],
    found: dict[str, NDArray[Any]],
) -> None:
    from seamlog.mcap.cdr import column_forms

    fields = node.fields or ()
    inner = {f"{name}.{key}": form for key, form in column_forms(fields).items()}

    def read(part: Cursors) -> dict[str, Any]:
        here: dict[str, NDArray[Any]] = {}
        _walk(fields, part, name + ".", names, here)
        return here

    each = _each(node, cursors, read)
    for key, form in inner.items():
        if key in names:
            rows = each.get(key) or [[] for _ in range(len(cursors))]
            found[key] = objects([_gathered(values, form) for values in rows])


def _gathered(values: list[Any], form: Form) -> Any:
    if not values:
        return empty_of(form)
    return values if form.dtype is object else np.array(values, form.dtype)


def _each(
    node: Node, cursors: Cursors, read: Callable[[Cursors], dict[str, Any]]
) -> dict[str, list[list[Any]]]:
    """Elements of a sequence, one after the other; for each name a list per message."""
    if node.count == SEQUENCE:
        counts = cursors.counts()
    else:
        counts = np.full(len(cursors), node.count, np.int64)
    found: dict[str, list[list[Any]]] = {}
    for place in range(int(counts.max(initial=0))):
        chosen = np.flatnonzero(counts > place)
        part = cursors.part(chosen)
        for name, column in read(part).items():
            if column is None:
                continue
            rows = found.setdefault(name, [[] for _ in range(len(cursors))])
            for row, value in zip(chosen.tolist(), column, strict=True):
                rows[row].append(value)
        cursors.at[chosen] = part.at
    if not found:
        return {"": [[] for _ in range(len(cursors))]}
    return found
