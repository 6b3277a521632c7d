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
