"""Figures of the long runs, printed at the end of `make soak`."""

import operator
from collections.abc import Callable

Tell = Callable[..., None]
ROWS: list[str] = []


def tell(name: str, value: float, unit: str, target: str = "") -> None:
    """Print `value` at the end; fail unless it keeps `target`, such as "<= 60"."""
    kept = True
    if target:
        relation, bound = target.split()
        compare = {"<=": operator.le, ">=": operator.ge}[relation]
        kept = bool(compare(value, float(bound)))
    ROWS.append(f"{name:<64} {value:>10.4g} {unit:<5} {target:<8} {'' if kept else 'MISSED'}")
    assert kept, f"{name}: {value:.4g} {unit}, wanted {target}"
