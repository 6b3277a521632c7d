"""What the doubts say of a band that lies inside another one."""

from dataclasses import replace

import pytest

from seamlog.analysis.bead.confidence import Evidence, confidence, doubts, may_be_tint, tint
from seamlog.analysis.bead.measurement import TRUSTED

CLEAR = Evidence(
    apart=3.0, band=0.9, flagged=0.1, rival=0.2, inner=0.3, flank=3.0, nested=0.0, sharper=0.0,
    step_grey=50.0, lengths=20.0, width_px=120.0, astray=0.01, blur_px=1.3,
)  # fmt: skip


def trusted(evidence: Evidence) -> bool:
    return confidence(doubts(evidence)) >= TRUSTED


def test_a_clear_bead_is_trusted() -> None:
    assert trusted(CLEAR)
    assert tint(CLEAR)[0] == 0.0


@pytest.mark.parametrize(
    "changed",
    [
        {"inner": 0.8, "flank": 1.1},
        {"inner": 0.8, "flank": 1.9, "blur_px": 3.0},
        {"inner": 0.66, "flank": 1.4, "blur_px": 4.0},
        {"inner": 0.3, "sharper": 2.0, "flank": 1.4, "blur_px": 4.0},
    ],
)
def test_a_band_like_a_film_with_another_inside_is_doubted(changed: dict[str, float]) -> None:
    evidence = replace(CLEAR, **changed)
    assert may_be_tint(evidence.inner, evidence.blur_px, evidence.width_px)
    assert tint(evidence)[0] > 0.5
    assert not trusted(evidence)


def test_soft_toes_of_a_rough_surface_are_no_tint() -> None:
    assert trusted(replace(CLEAR, inner=0.66, flank=3.0, blur_px=4.0))


def test_a_band_inside_is_trusted_where_the_outer_one_is_a_tint() -> None:
    assert trusted(replace(CLEAR, nested=0.1))
    assert not trusted(replace(CLEAR, nested=1.0))
    assert not trusted(replace(CLEAR, nested=0.1, blur_px=3.0))
