"""Progress of long work, shown on a terminal's stderr and nowhere else."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

Item = TypeVar("Item")


def track(items: Iterable[Item], label: str, total: int | None = None) -> Iterator[Item]:
    """Yield `items`, with a bar named `label` while a person watches."""
    if not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import track as rich_track

    console = Console(stderr=True)
    yield from rich_track(items, description=label, total=total, console=console, transient=True)


@contextmanager
def spinner(label: str) -> Iterator[None]:
    """Show `label` with a spinner while the block runs and a person watches."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(label):
        yield


def tell(line: str) -> None:
    """Say something while a command runs, on stderr."""
    sys.stderr.write(line + "\n")
    sys.stderr.flush()
