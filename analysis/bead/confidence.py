"""How far a measured width may be trusted: what could be wrong with it, each as a doubt."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_INNER = 0.6
"""Evidence of a band inside, relative to the whole, from which on it may be the bead."""


def soft_px(width_px: float) -> float:
    """Blur of a toe from which on it may be the fading end of something rather than a toe."""
    return max(2.0, 0.015 * width_px)


def _sharp_px(width_px: float) -> float:
    """Blur of a toe up to which it is one, whatever band lies inside."""
    return float(np.clip(0.006 * width_px, 1.5, 3.5))


def may_be_tint(inner: float, blur_px: float, width_px: float) -> bool:
    """Whether what was found may be a heat tint, so that the surface beside its toes counts.

    For the arguments see `Evidence`.
    """
    return inner > _INNER or blur_px > soft_px(width_px)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a width rests on.

    `apart`: distance of bead and plate at the worse toe, in standard deviations. `band`: evidence
    of the coarse band, 0 to 1. `flagged`: part of the stations. `rival` and `inner`: evidence of
    the best band beside and inside the found one, relative to it; `flank`: how much rougher the
    surface beside the inner one is than the plate (inf: not looked for). `nested`: how sure it is
    that the more evident band that it lies inside is no tint (0: it lies in none); `sharper`: how
    many times sharper than its toes a band inside is (0: none, or not looked for). `step_grey`: the
    weaker toe's step in grey levels; `lengths`: length of the bead in widths (inf where it runs out
    of the photo at both ends). `width_px`; `astray`: distance between the sharpest edge and the
    change of looks, part of the width; `blur_px` of the sharper toe.
    """

    apart: float
    band: float
    flagged: float
    rival: float
    inner: float
    flank: float
    nested: float
    sharper: float
    step_grey: float
    lengths: float
    width_px: float
    astray: float
    blur_px: float


@dataclass(frozen=True, slots=True)
class Doubt:
    """One thing that could be wrong: `confidence` 0 to 1 that it is not, and what it would be."""

    confidence: float
    sentence: str


def tint(e: Evidence) -> tuple[float, str]:
    """How much speaks for a heat tint around the bead, 0 to 1, and what."""
    inside = max(np.clip((e.inner - _INNER) / 0.2, 0, 1), np.clip((e.sharper - 1.5) / 0.5, 0, 1))
    soft = np.clip((e.blur_px - soft_px(e.width_px)) / 2.0, 0, 1)
    film = np.clip((e.inner - _INNER) / 0.15, 0, 1) * np.clip((1.6 - e.flank) / 0.3, 0, 1)
    soft_at_all = np.clip((e.blur_px - soft_px(e.width_px)) / 0.5, 0, 1)
    alike = np.clip((1.8 - e.flank) / 0.3, 0, 1)
    faded = max(np.clip((e.inner - 0.5) / 0.15, 0, 1), np.clip((e.sharper - 1) / 0.3, 0, 1))
    # Soft toes of a surface rougher than the plate are out of focus or ragged, no fading tint.
    smooth = 1.0 if np.isinf(e.flank) else np.clip((2.6 - e.flank) / 0.8, 0, 1)
    edges = smooth * max(0.5 * soft, inside * _less_sharp(e))
    tinted = max(edges, film, soft_at_all * alike * faded)
    what = "its edges are soft" if film < tinted else "the surface is as on the plate"
    return float(tinted), f"a narrower band lies inside, and {what}: a heat tint?"


def _less_sharp(e: Evidence) -> float:
    """0 for toes that are surely ones, 1 for those a px more blurred."""
    return float(np.clip(e.blur_px - _sharp_px(e.width_px), 0, 1))


def doubts(evidence: Evidence) -> list[Doubt]:
    """All doubts, the worst first."""
    e = evidence
    less_sharp = _less_sharp(e)
    tinted, looks_tinted = tint(e)
    nested = max(e.nested, less_sharp) if e.nested else 0.0
    found = [
        (e.apart / 1.2, "bead and plate look alike at a toe"),
        (e.band / 0.6, "hardly any band differs from both its sides"),
        ((1 - e.flagged) / 0.7, f"{100 * e.flagged:.0f} % of the stations are flagged"),
        ((1.1 - e.rival) / 0.4, "another band in the photo looks as much like a bead"),
        (e.width_px / 30, f"the bead is only {e.width_px:.0f} px across, 30 or more are wanted"),
        (1.3 - e.astray / 0.1, "the sharpest edges are not where the looks change"),
        (e.step_grey / 8, f"a toe's step is {e.step_grey:.1f} grey levels only"),
        (e.lengths / 10, f"it is {e.lengths:.1f} times as long as wide: a bead is longer"),
        (
            max(0.45, 1 - nested * (0.5 + 0.5 * less_sharp)),
            "it lies inside a broader band that is as evident: a heat tint?",
        ),
        (1 - 0.75 * tinted, looks_tinted),
    ]
    judged = [Doubt(float(np.clip(value, 0, 1)), sentence) for value, sentence in found]
    return sorted(judged, key=lambda doubt: doubt.confidence)


def confidence(found: Sequence[Doubt]) -> float:
    """That none of the doubts is true, 0 to 1: they are about different things and multiply."""
    return math.prod(doubt.confidence for doubt in found)


def serious(found: Sequence[Doubt]) -> list[str]:
    """Sentences of the doubts that a person should know."""
    return [doubt.sentence for doubt in found if doubt.confidence < 0.9]
