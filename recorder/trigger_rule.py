"""Rules that trigger a snapshot: `abs(error) > 1 mm`, `/weld/process.current_a < 20 A`.

A rule compares one field of a fixed-width topic, or its magnitude, with a number. `error` is the
position of `/table/reference`, the latest at that time, minus that of `/table/encoder`.
"""

import operator
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from seamlog.channels import CHANNELS
from seamlog.errors import UsageError
from seamlog.messages import is_fixed, layout

from .ring import RECORD

_RULE = re.compile(
    r"(?P<abs>abs\()?\s*(?P<what>error|(?P<topic>/[a-z0-9_/]+)\.(?P<field>[a-z0-9_]+))\s*"
    r"(?P<close>\))?\s*(?P<relation>>=|<=|>|<)\s*(?P<number>[-+0-9.eE]+)\s*(?P<unit>\S*)"
)
_RELATIONS = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}
_UNITS = {"mm": ("m", 1e-3), "um": ("m", 1e-6), "mm/s": ("m/s", 1e-3), "mm/s^2": ("m/s^2", 1e-3)}
_UNITS |= {"mA": ("A", 1e-3), "kA": ("A", 1e3), "mV": ("V", 1e-3), "s": ("ns", 1e9)}
_ENCODER, _REFERENCE, _POSITION = "/table/encoder", "/table/reference", "position_m"
_LOG_TIME = slice(15, 23)


@dataclass(frozen=True, slots=True)
class TriggerRule:
    """A rule as it was read; `bound` in the field's own unit."""

    text: str
    topic: str
    field: str
    is_error: bool
    is_magnitude: bool
    relation: str
    bound: float

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics whose messages it needs."""
        return (_ENCODER, _REFERENCE) if self.is_error else (self.topic,)

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the rule holds; never for NaN."""
        found = np.abs(values) if self.is_magnitude else values
        return np.asarray(_RELATIONS[self.relation](found, self.bound))


def parse_rule(text: str) -> TriggerRule:
    """Read a rule; `UsageError` says what is wrong with it."""
    match = _RULE.fullmatch(text.strip())
    if match is None or bool(match["abs"]) != bool(match["close"]):
        raise UsageError(
            f"{text!r} is no rule; write it as 'abs(error) > 1 mm' or "
            "'/weld/process.current_a < 20 A'"
        )
    is_error = match["what"] == "error"
    topic, name = (_ENCODER, _POSITION) if is_error else (match["topic"], match["field"])
    if topic not in CHANNELS or not is_fixed(CHANNELS[topic]):
        raise UsageError(f"{text!r}: {topic} is no topic of fixed-width messages")
    units = {field.name: field.unit for field in CHANNELS[topic].fields if "[" not in field.type}
    if name not in units:
        raise UsageError(f"{text!r}: {topic} has the fields {', '.join(units)}")
    try:
        number = float(match["number"])
    except ValueError:
        raise UsageError(f"{text!r}: {match['number']!r} is no number") from None
    bound = number * _factor(text, match["unit"], units[name])
    return TriggerRule(text, topic, name, is_error, bool(match["abs"]), match["relation"], bound)


def _factor(text: str, unit: str, wanted: str) -> float:
    if not unit or wanted in ("", "1", "metadata"):
        if not unit and wanted not in ("", "1", "metadata"):
            raise UsageError(f"{text!r}: say the unit, such as {wanted}")
        return 1.0
    base, factor = _UNITS.get(unit, (unit, 1.0))
    if base != wanted:
        raise UsageError(f"{text!r}: the field is in {wanted}, which {unit} is no unit of")
    return factor


class RuleWatch:
    """Applies one rule to records as they come, topic by topic."""

    def __init__(self, rule: TriggerRule) -> None:
        self.rule = rule
        empty = (np.zeros(0, np.int64), np.zeros(0))
        self._reference = self._encoder = empty

    def span(self, topic: str, records: NDArray[np.uint8]) -> tuple[int, int] | None:
        """Log times of the first and last message of `records` (n, stride) for which it holds."""
        times = records[:, _LOG_TIME].copy().view("<i8").ravel()
        name = _POSITION if self.rule.is_error else self.rule.field
        values = _column(topic, name, records)
        if self.rule.is_error:
            times, values = self._errors(topic, times, values)
        where = np.flatnonzero(self.rule.holds(values))
        return (int(times[where[0]]), int(times[where[-1]])) if len(where) else None

    def _errors(
        self, topic: str, times: NDArray[np.int64], values: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Errors at the encoder's times, as far as the reference is known by now."""
        if topic == _REFERENCE:
            kept = slice(-1, None)
            known_times, known = self._reference
            self._reference = (
                np.concatenate((known_times[kept], times)),
                np.concatenate((known[kept], values)),
            )
            times, values = np.zeros(0, np.int64), np.zeros(0)
        waiting_times, waiting = self._encoder
        times = np.concatenate((waiting_times, times))
        values = np.concatenate((waiting, values))
        known_times, known = self._reference
        ready = int(np.searchsorted(times, known_times[-1], "right")) if len(known_times) else 0
        self._encoder = times[ready:], values[ready:]
        places = np.searchsorted(known_times, times[:ready], "right") - 1
        errors = np.where(places >= 0, known[np.maximum(places, 0)], np.nan) - values[:ready]
        return times[:ready], errors


def _column(topic: str, name: str, records: NDArray[np.uint8]) -> NDArray[np.float64]:
    form, offset = layout(topic).numpy_fields()[name]
    start = RECORD.size + offset
    width = np.dtype(form).itemsize
    return records[:, start : start + width].copy().view(form).ravel().astype(np.float64)
