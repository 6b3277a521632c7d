"""What happens to a message that does not get into its ring: counted, explained, waited for."""

import threading
import time
from collections.abc import Callable
from typing import Any

from seamlog.channels import CHANNELS
from seamlog.errors import RecordingError

from .ring import (
    DROPPED,
    FIRST_DROPPED,
    LAST_DROPPED,
    REFUSED,
    REFUSED_FOREIGN,
    TAIL,
    Ring,
)

_NAP_S = 0.0005
_PATIENCE_S = 30.0
"""A simulated loop waits at most this long for a recorder that takes nothing."""


class Gate:
    """The slow paths of one channel; the fast one is in its `put`.

    `waits` is true for simulated sources; `is_alive` tells whether the recorder process lives.
    """

    def __init__(
        self, topic: str, ring: Ring, waits: bool, strict: bool, is_alive: Callable[[], bool]
    ) -> None:
        self.topic = topic
        self.ring = ring
        self.waits = waits
        self.strict = strict
        self.is_open = True
        self.ending = ""
        """Why the recording has stopped before it was closed; messages after it are counted."""
        self.owner = threading.get_ident()
        self._owner_name = threading.current_thread().name
        self._is_alive = is_alive
        self._foreign = threading.Lock()

    def new_limit(self, number: int) -> int:
        """How many messages a fixed ring has room for in all.

        Waits for room for message `number` where the source is simulated.
        """
        words, slots = self.ring.words, self.ring.slots
        self.has_room(lambda: number < words[TAIL] + slots)
        return int(words[TAIL]) + slots

    def has_room(self, fits: Callable[[], bool]) -> bool:
        """True once `fits` is; waits for it where the source is simulated."""
        if not self.is_open:
            return False
        if not self.waits or fits():
            return fits()
        tail, since = self.ring.words[TAIL], time.monotonic()
        while not fits() and self.is_open and self._is_alive():
            time.sleep(_NAP_S)
            if self.ring.words[TAIL] != tail:
                tail, since = self.ring.words[TAIL], time.monotonic()
            elif time.monotonic() - since > _PATIENCE_S:
                break
        return self.is_open and fits()

    def drop(self, sequence: int) -> bool:
        """Count a message that found the ring full; `sequence` is the one it would have had."""
        words = self.ring.words
        words[DROPPED] += 1
        words[LAST_DROPPED] = sequence + 1
        reason = "the ring is full: the recorder does not keep up"
        if not words[FIRST_DROPPED]:
            words[FIRST_DROPPED] = sequence + 1
            self.ring.keep_reason(reason)
        return self._complain(reason)

    def refuse(self, reason: str) -> bool:
        """Count a message that is not valid; called by the owner's thread."""
        self.ring.keep_reason(reason)
        self.ring.words[REFUSED] += 1
        return self._complain(reason)

    def refuse_values(self, values: tuple[Any, ...], error: Exception | str) -> bool:
        """Refuse a message whose `values`, the stamp first, cannot be packed."""
        wanted = ", ".join(CHANNELS[self.topic].field_names)
        got = ", ".join(_short(value) for value in values)
        return self.refuse(f"put({wanted}) cannot take ({got}): {error}")

    def refuse_closed(self) -> bool:
        """A message after the end of the recording."""
        if self.ending:
            return self.refuse(self.ending)
        return self._complain("the recording is closed")

    def refuse_foreign(self) -> bool:
        """Count a message of a thread that the channel does not belong to."""
        reason = (
            f"the channel belongs to thread {self._owner_name!r}; "
            f"{threading.current_thread().name!r} needs one of its own from recorder.channel()"
        )
        with self._foreign:
            self.ring.keep_reason(reason)
            self.ring.words[REFUSED_FOREIGN] += 1
        return self._complain(reason)

    def _complain(self, reason: str) -> bool:
        if self.strict:
            raise RecordingError(f"{self.topic}: message not recorded: {reason}")
        return False


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - it is the caller's object
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 40 else text[:37] + "..."
