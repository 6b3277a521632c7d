"""The second opinion: a recovered session is read by the `mcap` package before it counts."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from seamlog.errors import SessionError


def check_by_second_reader(path: Path, counts: Mapping[int, int]) -> None:
    """Read every message of `path`, CRCs checked; `SessionError` unless `counts` come out.

    `counts` are messages by channel id.
    """
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    found: Counter[int] = Counter()
    try:
        with path.open("rb") as file:
            reader = make_reader(file, validate_crcs=True)
            for _, channel, _ in reader.iter_messages(log_time_order=False):
                found[channel.id] += 1
            for _ in reader.iter_attachments():
                pass
    except (McapError, ValueError, KeyError, EOFError) as error:
        raise SessionError(
            f"{path}: the recovered session does not read back ({error}); nothing was changed, "
            "please report this with the file"
        ) from error
    if found != Counter({number: count for number, count in counts.items() if count}):
        raise SessionError(
            f"{path}: {sum(found.values())} messages read back where {sum(counts.values())} were "
            "recovered; nothing was changed, please report this with the file"
        )
