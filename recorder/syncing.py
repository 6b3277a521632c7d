"""Syncs to disk in a thread of their own: a slow disk holds up neither rings nor chunks."""

import os
import threading


class Syncer:
    """Syncs one file on request; several requests during a sync become one more sync.

    A sync that failed is never tried again: what it had to bring to disk may be gone for good.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._wanted = threading.Event()
        self._mark = 0
        self._is_ending = False
        self.done_mark = 0
        """Mark of the last request that is on the disk."""
        self.error: OSError | None = None
        """Why syncing has ended before its time."""
        self._thread = threading.Thread(target=self._run, name="sync", daemon=True)
        self._thread.start()

    def request(self, mark: int) -> None:
        """Sync what is written by now; `mark` (> 0) tells this request from others."""
        self._mark = mark
        self._wanted.set()

    def end(self) -> None:
        """Wait for the sync that is running and take no more requests."""
        self._is_ending = True
        self._wanted.set()
        self._thread.join()

    def _run(self) -> None:
        while self._wanted.wait() and not self._is_ending:
            self._wanted.clear()
            mark = self._mark
            try:
                os.fdatasync(self._descriptor)
            except OSError as error:
                self.error = error
                return
            self.done_mark = mark
