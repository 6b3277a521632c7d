"""What is wrong with a file: where, since when, why, and what to do about it."""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from enum import Enum
from pathlib import Path
from typing import Any

_MOST = 20
"""Findings of one id and topic that are told one by one."""


class Severity(Enum):
    """How bad it is."""

    ERROR = "error"
    """Something is missing, damaged or wrong."""
    WARNING = "warning"
    """Nothing is missing from the file, but the recording was disturbed."""
    NOTE = "note"
    """Good to know."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong; `id` names its kind, for programs.

    `offset` and `length` are bytes of `path`, times are log times; None where there is none.
    """

    id: str
    severity: Severity
    path: Path
    cause: str
    action: str
    offset: int | None = None
    length: int | None = None
    topic: str | None = None
    start_ns: int | None = None
    end_ns: int | None = None

    def document(self) -> dict[str, Any]:
        """As JSON-ready values."""
        return asdict(self) | {"severity": self.severity.value, "path": str(self.path)}

    def place(self) -> str:
        """Where it is, in words."""
        parts = [] if self.offset is None else [f"byte {self.offset}"]
        if self.offset is not None and self.length:
            parts[0] += f" to {self.offset + self.length}"
        parts += [self.topic] if self.topic else []
        return ", ".join(parts)


def few(findings: Iterable[Finding]) -> Iterator[Finding]:
    """`findings` without those of a kind and topic that go on and on: these are counted."""
    seen: dict[tuple[str, str | None, Path], list[Finding]] = {}
    for finding in findings:
        alike = seen.setdefault((finding.id, finding.topic, finding.path), [])
        alike.append(finding)
        if len(alike) <= _MOST:
            yield finding
    for alike in seen.values():
        if len(alike) > _MOST:
            last = alike[-1]
            more = f"{len(alike) - _MOST} more of this kind; the last one: {last.cause}"
            yield Finding(
                last.id,
                last.severity,
                last.path,
                more,
                last.action,
                last.offset,
                last.length,
                last.topic,
                last.start_ns,
                last.end_ns,
            )
