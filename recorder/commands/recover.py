"""`seamlog recover`: what is left of a damaged or unfinished session, as a session of its own."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from seamlog.command import command, force_option, output_option, session_argument
from seamlog.outcome import Ending, Outcome

if TYPE_CHECKING:
    from seamlog.recorder.recovery import ChannelRecovery, Recovery


@command()
@session_argument
@output_option("The session to write; else SESSION without .part, or *.recovered.mcap.", False)
@force_option
def recover(session: Path, output: Path | None, force: bool) -> Outcome:
    """Save what is left of the file SESSION, and what its recorder still held in memory.

    SESSION is never changed. Only bytes that their CRC proves count; the result is read back by
    a second reader. Exit code 1 if something is lost, or may be.
    """
    from seamlog.recorder.recovery import recover as run

    found = run(session, output, force)
    document = {
        "input": str(found.source),
        "output": str(found.output),
        "is_complete": found.is_complete,
        "end_known": found.end_known,
        "rings": None if found.rings is None else str(found.rings),
        "channels": [asdict(row) for row in found.channels],
        "problems": found.problems,
    }
    ending = Ending.PASS if found.is_complete else Ending.FINDING
    return Outcome("seamlog.recover", _text(found), document, ending)


def _text(found: "Recovery") -> str:
    kept = sum(row.kept for row in found.channels)
    lines = [f"{found.output}: {kept} messages, read back by a second reader"]
    if found.rings is not None:
        rings = sum(row.from_rings for row in found.channels)
        lines.append(f"{rings} of them came from {found.rings}, which is removed now")
    wide = max((len(row.topic) for row in found.channels), default=5)
    lines.append(f"  {'topic':<{wide}}  {'kept':>9} {'lost':>9}")
    lines += [f"  {row.topic:<{wide}}  {_counts(row)}" for row in found.channels]
    lines += [f"  {problem}" for problem in found.problems]
    if not found.end_known:
        lines.append(
            "Nothing tells what came after the end of the file: 0.1 s at most where the recorder "
            "died, any amount where a copy was cut."
        )
    if found.is_complete:
        lines.append("Complete: nothing is missing.")
    elif found.has_losses:
        lines.append("Some of it is lost.")
    return "\n".join(lines)


def _counts(row: "ChannelRecovery") -> str:
    lost = "?" if row.lost is None else str(row.lost)
    counts = f"{row.kept:>9} {lost:>9}"
    return f"{counts}  ({row.unproved} without CRC)" if row.unproved else counts
