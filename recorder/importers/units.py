"""Units that an import map may name, as factors of the SI unit."""

_SI: dict[str, tuple[str, float]] = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "um": ("m", 1e-6),
    "inch": ("m", 0.0254),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "mm/min": ("m/s", 1e-3 / 60),
    "m/min": ("m/s", 1 / 60),
    "cm/min": ("m/s", 1e-2 / 60),
    "inch/min": ("m/s", 0.0254 / 60),
    "m/s^2": ("m/s^2", 1.0),
    "mm/s^2": ("m/s^2", 1e-3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "kA": ("A", 1e3),
    "V": ("V", 1.0),
    "mV": ("V", 1e-3),
}


_SPELLINGS = {
    "in": "inch",
    "µm": "um",
    "μm": "um",
    "m/s²": "m/s^2",
    "mm/s²": "mm/s^2",
    "m/s2": "m/s^2",
    "mm/s2": "mm/s^2",
    "in/min": "inch/min",
    "ipm": "inch/min",
    "amps": "A",
    "ampere": "A",
    "volt": "V",
    "volts": "V",
    "meter": "m",
    "meters": "m",
    "millimeter": "mm",
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
}
_TIMES = ("s", "ms", "us", "ns", "min")


def spelled(unit: str) -> str:
    """The unit as it is written here."""
    bare = unit.strip()
    return _SPELLINGS.get(bare, _SPELLINGS.get(bare.lower(), bare))


def is_unit(text: str) -> bool:
    """Whether a text is a unit that is known here, or looks like one of time, force or angle."""
    found = spelled(text)
    return (
        found in _SI or found in _TIMES or found in ("N", "Nm", "kN", "Hz", "rad", "deg", "%", "°C")
    )


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
