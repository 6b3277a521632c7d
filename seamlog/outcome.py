"""What a command gives back: a document for programs, text for people, and how it ended.

Commands do not print and know no exit codes; `seamlog.cli` does both from this.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class Ending(Enum):
    """How a command that ran to its end ended."""

    PASS = "pass"
    FINDING = "finding"
    """It ran, and there is a finding, a FAIL, a regression or a loss."""
    BATCH_FAILED = "batch failed"
    """A part of a batch failed."""
    NO_EVIDENCE = "no evidence"
    """A verdict was asked for and refused."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """`document` is JSON-ready; `schema` names it and `version` counts its changes."""

    schema: str
    text: str
    document: dict[str, Any] = field(default_factory=dict)
    ending: Ending = Ending.PASS
    version: int = 1
