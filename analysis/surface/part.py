"""The surface as a part of the results: spatter, gaps, ends, candidates with pictures."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.bead.image import Photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane
from seamlog.analysis.bead.sources import Before
from seamlog.errors import EvidenceError
from seamlog.results import Columns, Figure, Finding, Input, Part, Picture, Place, Severity

from .candidates import Candidate, contact_sheet, find_candidates
from .ends import BeadEnd, Gap, bead_ends, bead_gaps
from .spatter import Spatter, find_spatter

Tables = Mapping[str, tuple[Columns, Mapping[str, str]]]
Pictures = Mapping[str, tuple[bytes, Picture]]

_BANDS_MM = (0.0, 2.0, 5.0, 10.0, 20.0)
_LONGEST_PX = 1600
_NO_HEIGHT = "no laser stripe in the log: height cannot be seen from above"
HEIGHTS = {
    "height_mm": "Excess weld metal",
    "toe_angle_deg": "Toe angle",
    "undercut_depth_mm": "Undercut depth",
    "misalignment_mm": "Linear misalignment",
}
"""What only a laser stripe can tell."""


def surface_part(
    photo: Photo,
    plane: Plane,
    bead: BeadMeasurement,
    before: Before | None = None,
    inputs: Sequence[Input] = (),
    index: int = 1,
    weld: int | None = None,
    heights: Sequence[Figure] = (),
) -> tuple[Part, Tables, Pictures]:
    """Part `surface` of one measured photo; what cannot be told is there with the reason.

    `heights` are the figures of a laser stripe; without them height is "not measured".
    """
    name = photo.name.rsplit("/", 1)[-1]
    spatter, refusal = _spatter(photo, plane, bead, before)
    was_compared = spatter is not None and spatter.known_before is not None
    compared = before.photo.name if before is not None and was_compared else None
    ends, gaps = bead_ends(bead), bead_gaps(bead)
    candidates = find_candidates(photo, plane, bead) if bead.trusted else []
    part = Part(
        part="surface",
        index=index,
        title=f"Surface, {name}",
        weld=weld,
        inputs=list(inputs),
        reason="the surface is judged by limits in part quality, if any were given",
        figures=[
            *_spatter_figures(spatter, refusal, bead),
            *_gap_figures(gaps, bead),
            *(_end_figure(end) for end in ends),
            *(heights or (_unseen(*item) for item in HEIGHTS.items())),
        ],
        findings=_findings(ends, gaps, candidates, bead, weld),
        details={"unit": bead.unit, "before": compared},
    )
    pictures = {}
    if spatter is not None:
        pictures["spatter"] = _picture(
            _drawn(photo, spatter), "Photo with what counts as spatter (rings)"
        )
    if candidates:
        reach_px = 0.4 * float(np.nanmedian(bead.width)) / bead.unit_per_px
        pictures["candidates"] = _picture(
            contact_sheet(photo, candidates, max(reach_px, 8)),
            "Candidates to be looked at by a person: no verdict",
        )
    return part, _tables(spatter, candidates, bead), pictures


def _spatter(
    photo: Photo, plane: Plane, bead: BeadMeasurement, before: Before | None
) -> tuple[Spatter | None, str]:
    if not bead.trusted:
        return None, f"the bead itself is doubtful (confidence {bead.confidence:.2f})"
    try:
        return find_spatter(photo, plane, bead, before.photo if before else None), ""
    except EvidenceError as error:
        if before is None or before.was_named:
            return None, str(error)
    # The log's camera need not have seen this plate.
    return _spatter(photo, plane, bead, None)


def _spatter_figures(spatter: Spatter | None, refusal: str, bead: BeadMeasurement) -> list[Figure]:
    unit = bead.unit
    labels = {
        "spatter_count": ("Spatter, number", "1"),
        f"spatter_area_{unit}2": ("Spatter, area", f"{unit}^2"),
        "spatter_per_100mm": ("Spatter per 100 mm of bead, number", "1"),
        f"spatter_largest_{unit}": ("Spatter, largest diameter", unit),
        f"spatter_distance_{unit}": ("Spatter, median distance to the toe", unit),
    }
    values: dict[str, float | int | None] = dict.fromkeys(labels)
    why = refusal
    if spatter is not None:
        why = _how_far(spatter)
        count = len(spatter.blobs)
        values["spatter_count"] = count
        values[f"spatter_area_{unit}2"] = float(spatter.area.sum())
        if count:
            values[f"spatter_largest_{unit}"] = float(spatter.diameter.max())
            values[f"spatter_distance_{unit}"] = float(np.median(spatter.distance))
        length = float(np.ptp(bead.s))
        if unit == "mm" and length > 0:
            values["spatter_per_100mm"] = 100 * count / length
    missing = {"spatter_per_100mm": "no calibration"} if unit == "px" else {}
    nothing = "no spatter was found"
    return [
        Figure(
            name=name, label=label, value=values[name], unit=words,
            reason=why if values[name] is not None or spatter is None
            else missing.get(name, nothing),
        )
        for name, (label, words) in labels.items()
    ]  # fmt: skip


def _how_far(spatter: Spatter) -> str:
    text = f"from {spatter.smallest:.2g} {spatter.unit} across, up to {spatter.reach:.3g} "
    text += f"{spatter.unit} from the bead"
    if spatter.known_before is None:
        return f"{text}; without a picture from before welding, marks of the plate count too"
    return f"{text}; {spatter.known_before} marks were there before welding and do not count"


def _gap_figures(gaps: list[Gap], bead: BeadMeasurement) -> list[Figure]:
    missing = [gap.length for gap in gaps if gap.missing]
    hidden = [gap.length for gap in gaps if not gap.missing]
    return [
        Figure(name="gaps", label="Gaps without bead, number", value=len(missing), unit="1"),
        Figure(name=f"gap_length_{bead.unit}", label="Gaps without bead, length",
               value=float(sum(missing)), unit=bead.unit),
        Figure(name=f"hidden_length_{bead.unit}", label="Bead whose toes cannot be seen, length",
               value=float(sum(hidden)), unit=bead.unit),
    ]  # fmt: skip


def _end_figure(end: BeadEnd) -> Figure:
    return Figure(
        name=f"{end.name}_width_ratio",
        label=f"Width near the {end.name} against the whole bead",
        value=end.ratio,
        unit="1",
        reason=end.reason,
    )


def _unseen(name: str, label: str) -> Figure:
    return Figure(
        name=name, label=label, value=None, unit=name.rsplit("_", 1)[-1], reason=_NO_HEIGHT
    )


def _findings(
    ends: list[BeadEnd],
    gaps: list[Gap],
    candidates: list[Candidate],
    bead: BeadMeasurement,
    weld: int | None,
) -> list[Finding]:
    def place(s: float) -> Place | None:
        return Place(s_mm=s, weld=weld) if bead.unit == "mm" else None

    found = [
        Finding(
            severity=Severity.WARNING,
            message=f"no bead over {gap.length:.1f} {bead.unit}",
            place=place(gap.start),
        )
        for gap in gaps
        if gap.missing
    ]
    found += [
        Finding(
            severity=Severity.WARNING,
            message=f"{end.name}: the bead is {100 * (end.ratio or 0):.0f} % of its usual width",
            place=place(end.s),
        )
        for end in ends
        if end.unusual
    ]
    return found + [
        Finding(
            severity=Severity.INFO,
            message=f"candidate {number}: might be {_WORDS[item.kind]}, look at the picture",
            place=place(item.s),
        )
        for number, item in enumerate(candidates, 1)
    ]


_WORDS = {"pore": "a pore", "crack": "a crack", "undercut": "undercut"}


def _tables(
    spatter: Spatter | None, candidates: list[Candidate], bead: BeadMeasurement
) -> dict[str, tuple[Columns, Mapping[str, str]]]:
    unit = bead.unit
    tables: dict[str, tuple[Columns, Mapping[str, str]]] = {}
    if spatter is not None and len(spatter.blobs):
        columns: dict[str, NDArray[Any]] = {
            "drop": np.arange(1, len(spatter.blobs) + 1),
            f"place_{unit}": spatter.s,
            f"distance_{unit}": spatter.distance,
            f"diameter_{unit}": spatter.diameter,
            "x_px": spatter.blobs.x_px,
            "y_px": spatter.blobs.y_px,
            "contrast": spatter.blobs.contrast,
        }
        units = {name: name.rsplit("_", 1)[-1] for name in columns if "_" in name}
        tables["spatter"] = (columns, units)
        if unit == "mm":
            tables["spatter_by_distance"] = _by_distance(spatter)
    if candidates:
        tables["candidates"] = (
            {
                "candidate": np.arange(1, len(candidates) + 1),
                "kind": np.array([item.kind for item in candidates], dtype=object),
                f"place_{unit}": np.array([item.s for item in candidates]),
                "x_px": np.array([item.x_px for item in candidates]),
                "y_px": np.array([item.y_px for item in candidates]),
            },
            {f"place_{unit}": unit, "x_px": "px", "y_px": "px"},
        )
    return tables


def _by_distance(spatter: Spatter) -> tuple[Columns, Mapping[str, str]]:
    edges = np.append(_BANDS_MM, np.inf)
    counts, _ = np.histogram(spatter.distance, edges)
    areas, _ = np.histogram(spatter.distance, edges, weights=spatter.area)
    names = [f"{a:g} to {b:g} mm" for a, b in pairwise(_BANDS_MM)]
    names.append(f"over {_BANDS_MM[-1]:g} mm")
    columns = {"from_toe": np.array(names, dtype=object), "count": counts, "area_mm2": areas}
    return columns, {"count": "1", "area_mm2": "mm^2"}


def _drawn(photo: Photo, spatter: Spatter) -> NDArray[np.uint8]:
    picture = photo.as_bgr8()
    factor = min(1.0, _LONGEST_PX / max(picture.shape[:2]))
    picture = np.asarray(
        cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA),
        dtype=np.uint8,
    )
    blobs = spatter.blobs
    for x, y, radius in zip(blobs.x_px, blobs.y_px, blobs.radius_px, strict=True):
        centre = (round(float(x) * factor), round(float(y) * factor))
        cv2.circle(
            picture, centre, round(float(radius) * factor) + 3, (40, 40, 230), 1, cv2.LINE_AA
        )
    return picture


def _picture(pixels: NDArray[np.uint8], caption: str) -> tuple[bytes, Picture]:
    done, data = cv2.imencode(".webp", pixels, [cv2.IMWRITE_WEBP_QUALITY, 82])
    if not done:
        raise ValueError(f"picture {caption!r} cannot be encoded")
    height, width = pixels.shape[:2]
    picture = Picture(
        file="picture.webp", caption=caption, width_px=width, height_px=height, sha256=""
    )
    return data.tobytes(), picture
