"""`seamlog compact`: a session in large chunks, which reads faster and is smaller."""

from pathlib import Path

from seamlog.command import command, force_option, output_option, session_argument
from seamlog.errors import UsageError
from seamlog.outcome import Ending, Outcome


@command()
@session_argument
@output_option("The session to write.")
@force_option
def compact(session: Path, output: Path, force: bool) -> Outcome:
    """Rewrite SESSION (all its files) into one file with chunks of 2 MiB, one channel each.

    No message is changed. What is damaged is left out and said (exit code 1).
    """
    from seamlog.files import check_output
    from seamlog.mcap.batch import BatchWriter
    from seamlog.progress import spinner
    from seamlog.session import open_session

    check_output(output, force)
    with open_session(session) as opened:
        if output.exists() and any(path.samefile(output) for path in opened.paths):
            raise UsageError(f"{output} is a file of the session itself; give another name")
        with spinner(f"compacting {session}"), BatchWriter(output, force) as writer:
            writer.compact_session(opened)
        before, problems = opened.info.size_bytes, opened.problems
        counted = opened.info.message_count
    with open_session(output) as written:
        count = written.info.message_count
    after = output.stat().st_size
    lines = [
        f"{session} -> {output}",
        f"{count} messages, {before} bytes before, {after} bytes after",
        *([f"{counted - count} messages could not be read"] if count < counted else []),
        *problems,
    ]
    document = {
        "session": str(session),
        "output": str(output),
        "messages": count,
        "lost": counted - count,
        "bytes_before": before,
        "bytes_after": after,
        "problems": problems,
    }
    ending = Ending.FINDING if problems or count < counted else Ending.PASS
    return Outcome("seamlog.compact", "\n".join(lines), document, ending)
