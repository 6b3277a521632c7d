"""How a benchmark tells its figures: a table for people, with --json one line per figure."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One figure; `target` is a bound in words such as ">= 80", empty if it is only stated."""

    name: str
    value: float
    unit: str
    target: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether the value keeps the target; None without one."""
        if not self.target:
            return None
        relation, bound = self.target.split()
        holds = self.value >= float(bound) if relation == ">=" else self.value <= float(bound)
        return bool(holds)


def options(description: str | None) -> argparse.Namespace:
    """`--json` and `--quick` (smaller data, for trying the benchmark itself)."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", action="store_true", help="one line of JSON per figure")
    parser.add_argument("--quick", action="store_true", help="small data; ratios mean less")
    return parser.parse_args()


def tell(title: str, figures: list[Figure], as_json: bool) -> None:
    """Print the figures; missed targets do not end the run, they are said."""
    if as_json:
        for figure in figures:
            sys.stdout.write(json.dumps(vars(figure) | {"holds": figure.holds}) + "\n")
        return
    width = max(len(figure.name) for figure in figures)
    sys.stdout.write(f"\n{title}\n")
    for figure in figures:
        word = {True: "holds", False: "MISSED", None: ""}[figure.holds]
        line = f"  {figure.name:<{width}}  {figure.value:>10.4g} {figure.unit:<8} {figure.target}"
        sys.stdout.write(f"{line:<{width + 36}} {word}".rstrip() + "\n")


def cpu_s(act: Callable[[], object], runs: int = 5) -> float:
    """Least CPU time of `act` over several runs, seconds."""
    best = float("inf")
    for _ in range(runs):
        start = time.process_time()
        act()
        best = min(best, time.process_time() - start)
    return best


@contextmanager
def optional_peer(name: str) -> Iterator[None]:
    """Leave a peer out, with a word on stderr, if it is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        sys.stderr.write(f"{name} left out: {error}\n")
