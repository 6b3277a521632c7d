"""Figures of the long runs, printed as one table at the end of `make soak`."""

import operator
from collections.abc import Callable, Iterator
from typing import NamedTuple

Tell = Callable[..., None]
_COMPARE = {"<=": operator.le, ">=": operator.ge}


class Row(NamedTuple):
    """One figure: the fault, what was measured, what is promised."""

    fault: str
    what: str
    value: float
    unit: str
    promise: str

    @property
    def is_kept(self) -> bool:
        """The promise holds, or there is none."""
        if not self.promise:
            return True
        relation, bound = self.promise.split()
        return bool(_COMPARE[relation](self.value, float(bound)))


ROWS: list[Row] = []


def tell(fault: str, what: str, value: float, unit: str = "", promise: str = "") -> None:
    """Print `value` at the end; fail unless it keeps `promise`, such as "<= 60"."""
    row = Row(fault, what, value, unit, promise)
    ROWS.append(row)
    assert row.is_kept, f"{fault}: {what} {value:.4g} {unit}, promised {promise}"


def table(rows: list[Row]) -> Iterator[str]:
    """Lines of the table, faults one after the other."""
    yield f"{'fault, and what was measured':<58} {'figure':>9} {'unit':<5} {'promise':<9}"
    fault = ""
    for row in rows:
        if row.fault != fault:
            fault = row.fault
            yield fault
        verdict = "" if not row.promise else "holds" if row.is_kept else "MISSED"
        line = f"  {row.what:<56} {row.value:>9.4g} {row.unit:<5} {row.promise:<9} {verdict}"
        yield line.rstrip()
