"""Options of `seamlog record` on how the recording is kept on the disk."""

import functools
import re
from collections.abc import Callable
from typing import Any

import click

from seamlog.errors import UsageError
from seamlog.recorder.storage import Snapshot, Storage

_UNITS = {"": 1, "kib": 1 << 10, "mib": 1 << 20, "gib": 1 << 30, "tib": 1 << 40}
_UNITS |= {"kb": 10**3, "mb": 10**6, "gb": 10**9, "tb": 10**12}


class Size(click.ParamType[int]):
    """A number of bytes with a unit: 500MB, 20GiB."""

    name = "size"

    def convert(self, value: Any, param: Any, ctx: Any) -> int:
        """Bytes."""
        match = re.fullmatch(r"(\d+(?:\.\d+)?) *([a-z]*)", str(value).lower())
        if match is None or match[2] not in _UNITS:
            self.fail(f"{value!r} is no size; write it as 500MB or 20GiB", param, ctx)
        return int(float(match[1]) * _UNITS[match[2]])


_OPTIONS = (
    click.option(
        "--sync",
        type=click.Choice(["eco", "default", "strict"]),
        default="default",
        help="Bring it to the disk each 5, 0.25 or 0.1 s; at once on arc off and faults.",
    ),
    click.option("--segment-size", type=Size(), default="256MiB", help="A file ends at this size"),
    click.option(
        "--segment-duration",
        type=click.FloatRange(min=0, min_open=True),
        default=600.0,
        help="or at this age in seconds, and the next begins.",
    ),
    click.option("--budget", type=Size(), help="Most disk for all files of the recording: 20GiB."),
    click.option(
        "--over-budget",
        type=click.Choice(["oldest", "stop"]),
        default="stop",
        help="Remove the oldest files, or stop.",
    ),
    click.option(
        "--snapshot",
        metavar="BEFORE+AFTER",
        help="Write only what is around a trigger, in seconds: 10+5. Faults and TRIGGER events "
        "trigger, as does the death of the loop.",
    ),
    click.option(
        "--trigger",
        "rules",
        multiple=True,
        metavar="RULE",
        help="Trigger by a value: 'abs(error) > 1 mm', '/weld/process.current_a < 20 A'.",
    ),
)


def storage_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options; the command gets one `storage` and one `snapshot`."""

    @functools.wraps(function)
    def run(
        *arguments: Any,
        sync: Any,
        segment_size: int,
        segment_duration: float,
        budget: int | None,
        over_budget: Any,
        snapshot: str | None,
        rules: tuple[str, ...],
        **others: Any,
    ) -> Any:
        storage = Storage(sync, segment_size, segment_duration, budget, over_budget)
        kept = _snapshot(snapshot, rules)
        return function(*arguments, storage=storage, snapshot=kept, **others)

    for option in reversed(_OPTIONS):
        run = option(run)
    return run


def _snapshot(span: str | None, rules: tuple[str, ...]) -> Snapshot | None:
    if span is None:
        if rules:
            raise UsageError("--trigger is for snapshot mode: add --snapshot 10+5")
        return None
    before, plus, after = span.partition("+")
    try:
        return Snapshot(float(before), float(after) if plus else 0.0, rules=rules)
    except ValueError:
        raise UsageError(f"--snapshot {span!r}: write seconds before+after, as 10+5") from None
