"""Units that an import map may name, as factors of the SI unit."""

_SI: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "um": ("m", 1e-6),
    "nm": ("m", 1e-9),
    "cm": ("m", 1e-2),
    "dm": ("m", 0.1),
    "km": ("m", 1e3),
    "inch": ("m", 0.0254),
    "mil": ("m", 2.54e-5),
    "ft": ("m", 0.3048),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "cm/s": ("m/s", 1e-2),
    "um/s": ("m/s", 1e-6),
    "inch/s": ("m/s", 0.0254),
    "km/h": ("m/s", 1 / 3.6),
    "m/h": ("m/s", 1 / 3600),
    "mm/min": ("m/s", 1e-3 / 60),
    "m/min": ("m/s", 1 / 60),
    "cm/min": ("m/s", 1e-2 / 60),
    "inch/min": ("m/s", 0.0254 / 60),
    "m/s^2": ("m/s^2", 1.0),
    "mm/s^2": ("m/s^2", 1e-3),
    "cm/s^2": ("m/s^2", 1e-2),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "kA": ("A", 1e3),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
    "kV": ("V", 1e3),
}


_SPELLINGS = {
    "in": "inch",
    "µm": "um",
    "μm": "um",
    "m/s²": "m/s^2",
    "mm/s²": "mm/s^2",
    "m/s2": "m/s^2",
    "mm/s2": "mm/s^2",
    "µm/s": "um/s",
    "μm/s": "um/s",
    "mils": "mil",
    "thou": "mil",
    "feet": "ft",
    "in/min": "inch/min",
    "in/s": "inch/s",
    "ips": "inch/s",
    "ipm": "inch/min",
    "amps": "A",
    "ampere": "A",
    "volt": "V",
    "volts": "V",
    "meter": "m",
    "meters": "m",
    "millimeter": "mm",
    "centimeter": "cm",
    "sec": "s",
    "sek": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "µs": "us",
    "μs": "us",
    "usec": "us",
    "nsec": "ns",
    "minutes": "min",
    "hour": "h",
    "hours": "h",
    "std": "h",
    "day": "d",
    "days": "d",
}
TIMES = ("s", "ms", "us", "ns", "min", "h", "d")
_OTHER_NAMES = (
    "N Nm kN Hz kHz rad mrad deg rev rpm 1/min rad/s deg/s % °C degC °F K bar mbar Pa kPa MPa W kW "
    "kg g l/min px counts cts inc ohm Ohm mT T dB"
)
_OTHERS = frozenset(_OTHER_NAMES.split())
"""Units that no field has; a column in one of them is never taken for metres."""


def spelled(unit: str) -> str:
    """The unit as it is written here."""
    bare = unit.strip()
    return _SPELLINGS.get(bare, _SPELLINGS.get(bare.lower(), bare))


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known here."""
    found = spelled(text)
    return found in _SI or found in TIMES or found in _OTHERS


def factor_between(unit: str, wanted: str) -> float | None:
    """Multiply a value in `unit` by this to have it in `wanted`; None if that is not known.

    A field whose unit stands in the channel metadata takes values as they are.
    """
    if unit == wanted or wanted == "metadata":
        return 1.0
    if unit not in _SI or wanted not in _SI:
        return None
    (kind, factor), (wanted_kind, wanted_factor) = _SI[unit], _SI[wanted]
    return factor / wanted_factor if kind == wanted_kind else None
