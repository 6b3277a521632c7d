"""Arctangent, exponential and logarithm from `+ - * /` alone.

The functions of libm and numpy change their last bits with the features of the processor; a
replay that must give the same bits everywhere uses these. Each reduces its argument by a table
of correctly rounded values and finishes with a Taylor polynomial; the error stays within a few
units in the last place (`tests/analysis/test_deterministic.py`).
"""

import math

_HALF_PI = 1.5707963267948966
_LN2 = 0.6931471805599453
_STEPS_PER_LN2 = 46.16624130844683
_STEP_HIGH, _STEP_LOW = 0.021660849335603416, 5.689487495325457e-11
"""ln(2) / 32 in two parts; products of the first with integers below 2^24 are exact."""

_ATAN_SIXTEENTHS = (
    0.0,
    0.06241880999595735,
    0.12435499454676144,
    0.18534794999569476,
    0.24497866312686414,
    0.3028848683749714,
    0.35877067027057225,
    0.4124104415973873,
    0.4636476090008061,
    0.5123894603107377,
    0.5585993153435624,
    0.6022873461349642,
    0.6435011087932844,
    0.6823165548747481,
    0.7188299996216245,
    0.7531512809621944,
    0.7853981633974483,
)
_POWERS_OF_TWO = (
    1.0,
    1.0218971486541166,
    1.0442737824274138,
    1.0671404006768237,
    1.0905077326652577,
    1.1143867425958924,
    1.1387886347566916,
    1.1637248587775775,
    1.189207115002721,
    1.215247359980469,
    1.241857812073484,
    1.2690509571917332,
    1.2968395546510096,
    1.3252366431597413,
    1.3542555469368927,
    1.383909881963832,
    1.4142135623730951,
    1.4451808069770467,
    1.4768261459394993,
    1.5091644275934228,
    1.5422108254079407,
    1.5759808451078865,
    1.6104903319492543,
    1.645755478153965,
    1.681792830507429,
    1.718619298122478,
    1.7562521603732995,
    1.7947090750031072,
    1.8340080864093424,
    1.8741676341103,
    1.9152065613971474,
    1.9571441241754002,
)
_LOG_SIXTEENTHS = (
    0.0,
    0.06062462181643484,
    0.11778303565638346,
    0.17185025692665923,
    0.22314355131420976,
    0.27193371548364176,
    0.3184537311185346,
    0.3629054936893685,
    0.4054651081081644,
    0.44628710262841953,
    0.4855078157817008,
    0.5232481437645479,
    0.5596157879354227,
    0.5947071077466928,
    0.6286086594223741,
    0.661398482245365,
    0.6931471805599453,
)


def arctangent(x: float) -> float:
    """Angle whose tangent is `x`, rad; NaN stays NaN."""
    size = -x if x < 0.0 else x
    if size > 1.0:
        angle = _HALF_PI - _arctangent_to_one(1.0 / size)
    else:
        angle = _arctangent_to_one(size) if size <= 1.0 else size
    return -angle if x < 0.0 else angle


def _arctangent_to_one(x: float) -> float:
    near = int(16.0 * x + 0.5)
    node = near * 0.0625
    rest = (x - node) / (1.0 + x * node)
    square = rest * rest
    series = 1 / 9 - square * (1 / 11)
    series = 1 / 5 - square * (1 / 7 - square * series)
    series = 1.0 - square * (1 / 3 - square * series)
    return _ATAN_SIXTEENTHS[near] + rest * series


def exponential(x: float) -> float:
    """E to the power `x`; 0 below -745, `OverflowError` above 709; NaN stays NaN."""
    if not x >= -745.0:
        return 0.0 if x < 0.0 else x
    steps = math.floor(x * _STEPS_PER_LN2 + 0.5)
    rest = (x - steps * _STEP_HIGH) - steps * _STEP_LOW
    series = 1 / 24 + rest * (1 / 120 + rest * (1 / 720))
    series = rest + rest * rest * (0.5 + rest * (1 / 6 + rest * series))
    power = _POWERS_OF_TWO[steps & 31]
    return math.ldexp(power + power * series, steps >> 5)


def log_one_plus(x: float) -> float:
    """Natural logarithm of 1 + `x`, exact also for small `x`; `x` must exceed -1."""
    if -0.2 < x < 0.2:
        return _log_ratio(x / (2.0 + x))
    mantissa, exponent = math.frexp(1.0 + x)
    mantissa *= 2.0
    near = int(16.0 * (mantissa - 1.0) + 0.5)
    node = 1.0 + near * 0.0625
    tail = _LOG_SIXTEENTHS[near] + _log_ratio((mantissa - node) / (mantissa + node))
    return (exponent - 1) * _LN2 + tail


def _log_ratio(ratio: float) -> float:
    square = ratio * ratio
    series = 1 / 13 + square * (1 / 15 + square * (1 / 17))
    series = 1 / 7 + square * (1 / 9 + square * (1 / 11 + square * series))
    return 2.0 * (ratio + ratio * square * (1 / 3 + square * (1 / 5 + square * series)))
