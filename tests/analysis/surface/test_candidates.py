"""Candidates: flaws that are there are shown, sound beads show next to none."""

import numpy as np
import pytest

from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.synthetic import Scene
from seamlog.analysis.surface.candidates import Candidate, contact_sheet, find_candidates
from seamlog.analysis.surface.straightened import straightened
from seamlog.analysis.surface.synthetic_flaws import KINDS, Flaw, Flawed, flawed

SCENES = {
    "plain": Scene(noise=4),
    "rippled": Scene(noise=2, ripple=18, scallop_mm=0.12),
    "gleaming": Scene(noise=2, ripple=12, specular=1),
    "tinted": Scene(noise=2, texture=8, haz=35, gradient=0.4),
}


def shows(flaw: Flaw, found: Candidate) -> bool:
    return found.kind == flaw.kind and flaw.is_at(found.x_px, found.y_px)


def candidates(case: Flawed) -> list[Candidate]:
    return find_candidates(case.photo, case.plane, case.bead)


@pytest.mark.parametrize("name", SCENES)
def test_each_flaw_is_among_the_candidates(name: str) -> None:
    case = flawed(SCENES[name], KINDS * 2, 1)
    found = candidates(case)
    missed = [flaw for flaw in case.flaws if not any(shows(flaw, one) for one in found)]
    assert not missed
    strangers = [
        one for one in found if not any(flaw.is_at(one.x_px, one.y_px) for flaw in case.flaws)
    ]
    assert len(strangers) <= 1
    for one in found:
        nearest = int(np.argmin(np.hypot(*(case.bead.centre_px - (one.x_px, one.y_px)).T)))
        assert one.s == case.bead.s[nearest]


@pytest.mark.parametrize("name", SCENES)
def test_a_sound_bead_has_none(name: str) -> None:
    assert candidates(flawed(SCENES[name], (), 2)) == []


def test_a_photo_turned_by_a_quarter_shows_the_same() -> None:
    from seamlog.analysis.bead.plane import plane_of
    from seamlog.analysis.bead.strip import measure_strip

    case = flawed(SCENES["plain"], KINDS, 3)
    photo = make_photo(np.ascontiguousarray(np.rot90(case.photo.pixels)), "turned")
    plane = plane_of(photo, None)
    turned = find_candidates(photo, plane, measure_strip(photo, plane))
    last = case.photo.width_px - 1
    places = {one.kind: (one.y_px, one.x_px) for one in turned}
    for flaw in case.flaws:
        y, x = places[flaw.kind]
        assert flaw.is_at(last - y, x)


def test_a_straight_bead_leads_back_to_the_photo() -> None:
    case = flawed(SCENES["plain"], ("pore",), 4)
    straight = straightened(case.photo, case.plane, case.bead)
    assert straight is not None
    row, column = np.unravel_index(int(np.argmin(straight.light)), straight.light.shape)
    x, y = straight.to_px(float(row), float(column))
    (pore,) = case.flaws
    assert np.hypot(x - pore.x_px, y - pore.y_px) < pore.reach_px


def test_the_contact_sheet_shows_each() -> None:
    case = flawed(SCENES["plain"], KINDS, 5)
    found = candidates(case)
    sheet = contact_sheet(case.photo, found, 20.0)
    assert sheet.dtype == np.uint8
    assert sheet.shape == (160, 160 * len(found), 3)


def test_what_is_beside_the_photo_is_black_on_the_sheet() -> None:
    photo = make_photo(np.full((60, 80), 200, np.uint8), "grey")
    sheet = contact_sheet(photo, [Candidate("pore", 0.0, 30.0, 0.0, 9.0)], 20.0)
    assert (sheet[80:, :60] == 0).all()
    assert (sheet[80:, 90:] == 200).all()
