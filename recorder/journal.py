"""What the recorder process itself writes: its accounts, and events it notices."""

import numpy as np

from seamlog.channels import CHANNELS, EVENT_KINDS
from seamlog.messages import encode

from .accounts import Account
from .mcap_writer import SessionFile
from .pictures import message_record

STATUS_ID, EVENTS_ID = 1, 2
_STATUS, _EVENTS = CHANNELS["/seamlog/recorder"], CHANNELS["/events"]


class Journal:
    """Messages of the recorder process, on channels of their own."""

    def __init__(self, file: SessionFile) -> None:
        self._file = file
        self._sequences = {STATUS_ID: 0, EVENTS_ID: 0}
        producer = {"producer": "recorder"}
        file.add_channel(_STATUS.topic, STATUS_ID, producer)
        file.add_channel(_EVENTS.topic, EVENTS_ID, producer)

    def event(self, kind: str, detail: str, log_time_ns: int) -> None:
        """Write one event; `kind` as in `EVENT_KINDS`."""
        payload = encode(_EVENTS, (log_time_ns, EVENT_KINDS[kind], detail))
        self._write(EVENTS_ID, [payload], log_time_ns)

    def status(self, accounts: list[Account], free_bytes: int, log_time_ns: int) -> None:
        """Write one message per account."""
        rows = (status_values(account, free_bytes) for account in accounts)
        payloads = [encode(_STATUS, (log_time_ns, *values)) for values in rows]
        self._write(STATUS_ID, payloads, log_time_ns)

    def _write(self, channel_id: int, payloads: list[bytes], log_time_ns: int) -> None:
        first = self._sequences[channel_id]
        records = [
            message_record(channel_id, first + i, log_time_ns, log_time_ns, payload)
            for i, payload in enumerate(payloads)
        ]
        ends = np.cumsum([0, *(len(record) for record in records)], dtype=np.uint64)
        times = np.full(len(records), log_time_ns, np.uint64)
        self._file.write_chunk(channel_id, b"".join(records), times, ends[:-1], "zstd")
        self._sequences[channel_id] = first + len(records)


def status_values(account: Account, free_bytes: int) -> tuple[object, ...]:
    """Values of a `/seamlog/recorder` message behind its stamp."""
    return (
        account.topic,
        account.offered,
        account.accepted,
        account.dropped,
        account.refused,
        account.written,
        account.lost,
        account.first_dropped_sequence,
        account.last_dropped_sequence,
        account.ring_high_water,
        account.last_sync_ns,
        free_bytes,
        account.discarded,
        account.durable,
    )
