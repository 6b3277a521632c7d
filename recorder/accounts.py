"""The accounts of a recording: what was offered, what became of it, per channel.

offered = accepted + dropped + refused, and accepted = written + lost + discarded + waiting, where
waiting are those in the ring or in a chunk that is not written yet. Only snapshot mode discards.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from .ring import (
    DISCARDED,
    DROPPED,
    DURABLE,
    FIRST_DROPPED,
    HIGH_WATER_PPM,
    LAST_DROPPED,
    LAST_SYNC_NS,
    LOST,
    REFUSED,
    REFUSED_FOREIGN,
    WRITTEN,
    Ring,
)
from .storage import SYNC_S, SyncPolicy


def acknowledgement(sync: SyncPolicy) -> dict[str, str]:
    """What each level of acknowledgement survives, and when it is reached."""
    within_s = 0.1 + SYNC_S[sync]
    return {
        "accepted": "put returned True: survives the death of the live loop",
        "flushed": "handed to the system, within 0.1 s: survives the death of the recorder too",
        "durable": f"synced, within {within_s:.2g} s and the disk's own time, at once on arc off "
        "and faults: survives loss of power",
    }


@dataclass(frozen=True, slots=True)
class Account:
    """Counts of one channel; sequences are -1 where nothing was dropped."""

    topic: str
    producer: str
    accepted: int
    dropped: int
    refused: int
    written: int
    lost: int
    first_dropped_sequence: int
    last_dropped_sequence: int
    ring_high_water: float
    """Largest filled fraction of the ring."""
    last_sync_ns: int
    """Log time of the last sync to disk, 0 if there was none."""
    reason: str
    """Why the first message was turned away; empty if none was."""
    durable: int = 0
    """Messages that are synced to disk; of the written ones the first."""
    discarded: int = 0
    """Messages that were accepted and, in snapshot mode, belong to no snapshot."""
    longest_gap_s: float | None = None
    """Longest time between two messages in a row; None with fewer than two, or while running."""

    @property
    def offered(self) -> int:
        """Messages that the loop wanted to log."""
        return self.accepted + self.dropped + self.refused

    @property
    def waiting(self) -> int:
        """Accepted messages on their way to the file."""
        return self.accepted - self.written - self.lost - self.discarded


@dataclass(frozen=True, slots=True)
class Status:
    """A recording at one time; `findings` are in words, empty if all is well."""

    recording_id: str
    path: str
    is_recording: bool
    """The recorder process lives and takes messages."""
    channels: tuple[Account, ...]
    findings: tuple[str, ...]
    files: tuple[str, ...] = ()
    """The session's files at the end, in order; one unless it was long or a disk failed."""
    sync: SyncPolicy = "default"

    @property
    def is_complete(self) -> bool:
        """Nothing was dropped, refused or lost, and nothing else went wrong."""
        counts = (row.dropped + row.refused + row.lost for row in self.channels)
        return not self.findings and not any(counts)


def ring_account(topic: str, producer: str, ring: Ring, accepted: int) -> Account:
    """The account of a ring as its header tells it."""
    words = ring.words
    return Account(
        topic,
        producer,
        accepted,
        int(words[DROPPED]),
        int(words[REFUSED] + words[REFUSED_FOREIGN]),
        int(words[WRITTEN]),
        int(words[LOST]),
        int(words[FIRST_DROPPED]) - 1,
        int(words[LAST_DROPPED]) - 1,
        words[HIGH_WATER_PPM] / 1e6,
        int(words[LAST_SYNC_NS]),
        ring.reason,
        int(words[DURABLE]),
        int(words[DISCARDED]),
    )


def account_document(account: Account) -> dict[str, Any]:
    """`account` as JSON-ready values, with what follows from them."""
    derived = {"offered": account.offered, "waiting": account.waiting}
    return asdict(account) | derived


def read_account(document: Mapping[str, Any]) -> Account:
    """What `account_document` wrote."""
    return Account(**{field.name: document[field.name] for field in fields(Account)})
