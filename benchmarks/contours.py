"""Bead width on real photos, against contours that people drew around the beads (SEAMLOG_DATA).

A person's width is taken across the bead's axis, every 4 px along it, from toe to toe; ours are
averaged in the same slices. Each photo is measured by both definitions of the toe, and by the
first along a path that wanders in the bead, as a session would give it.
"""

import csv
import json
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from figures import Figure, options, tell
from numpy.typing import NDArray

from seamlog.analysis.bead.image import load_photo
from seamlog.analysis.bead.measurement import TOES, TRUSTED, BeadMeasurement
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.uniformity import uniformity
from seamlog.errors import SeamlogError

Floats = NDArray[np.float64]

SLICE_PX = 4
LEAST_SLICES = 20
WANDER, PHASES = 0.12, (0.0, 2.0)
"""How far a given path wanders, in widths, and where each of two such paths begins to."""
FAR_PERCENT = 25
"""An error beyond which a width must not be trusted."""


@dataclass(frozen=True)
class Contour:
    """What a person drew: polygons in photo px (n, 2), and the bead's axis and mean width."""

    path: Path
    polygons: list[NDArray[np.int32]]
    axis_deg: float
    mean_width_px: float

    def along_across(self, points: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Slice along the axis, and place across it in px, of points (n, 2)."""
        angle = np.deg2rad(self.axis_deg)
        axis = np.array([np.cos(angle), np.sin(angle)])
        slices = np.floor(points @ axis / SLICE_PX).astype(np.int64)
        return slices, points @ np.array([-axis[1], axis[0]])

    def width_px(self) -> dict[int, float]:
        """Toe to toe by slice."""
        rows, columns = cv2.imread(str(self.path)).shape[:2]
        mask = np.zeros((rows, columns), np.uint8)
        for polygon in self.polygons:
            cv2.fillPoly(mask, [polygon], 1)
        inside = np.argwhere(mask)[:, ::-1].astype(np.float64)
        slices, across = self.along_across(inside)
        return {int(k): float(np.ptp(across[slices == k])) + 1 for k in np.unique(slices)}


@dataclass(frozen=True)
class Compared:
    """One photo measured by one definition of the toe; NaN where it was refused.

    `correlation` is that of the width along the bead with the person's.
    """

    name: str
    toe: str
    human_px: float
    width_px: float = np.nan
    confidence: float = 0.0
    flagged_percent: float = np.nan
    correlation: float = np.nan

    @property
    def error_percent(self) -> float:
        """Measured - person's, in % of the person's."""
        return 100 * (self.width_px / self.human_px - 1)

    @property
    def verdict(self) -> str:
        """How the width is printed."""
        if np.isnan(self.width_px):
            return "refused"
        return "trusted" if self.confidence >= TRUSTED else "doubtful"


def contours() -> Iterator[Contour]:
    """All photos with a person's contour."""
    folder = Path(os.environ.get("SEAMLOG_DATA", "../shared/data")) / "bead_contours"
    with (folder / "ground_truth.csv").open() as file:
        for row in csv.DictReader(file):
            path = folder / f"{row['image']}.jpg"
            drawn = json.loads(path.with_suffix(".json").read_text())["weld_seam"]
            polygons = [np.rint(polygon).astype(np.int32) for polygon in drawn]
            mean_px = float(row["gt_mean_width_px"])
            yield Contour(path, polygons, float(row["axis_deg"]), mean_px)


def compare(contour: Contour, toe: str, phase: float | None = None) -> Compared:
    """Measure a photo and compare; with a `phase` along the bead's middle, wandering from it."""
    name, photo = contour.path.stem, load_photo(contour.path)
    plane = plane_of(photo, None)
    try:
        bead = measure_strip(photo, plane, toe=toe)
        if phase is not None:
            middle = bead.centre_px[:: len(bead.centre_px) // 40]
            wander = WANDER * contour.mean_width_px * np.sin(np.linspace(0, 9, len(middle)) + phase)
            bead = measure_strip(photo, plane, middle + wander[:, None] * (0.3, 1.0), toe=toe)
    except SeamlogError:
        return Compared(name, toe, contour.mean_width_px)
    even = uniformity(bead)
    return Compared(
        name, toe, contour.mean_width_px,
        width_px=even.mean if even else np.nan,
        confidence=bead.confidence,
        flagged_percent=100 * float((~bead.good).mean()),
        correlation=correlation(contour, bead),
    )  # fmt: skip


def correlation(contour: Contour, bead: BeadMeasurement) -> float:
    """Pearson's, over the slices that have both widths; NaN if they are few."""
    slices, _ = contour.along_across(bead.centre_px[bead.good])
    human, own = contour.width_px(), bead.width[bead.good]
    pairs = [(human[k], own[slices == k].mean()) for k in np.unique(slices).tolist() if k in human]
    if len(pairs) < LEAST_SLICES:
        return np.nan
    return float(np.corrcoef(np.array(pairs).T)[0, 1])


def figures_of(toe: str, found: list[Compared], needed: str = "") -> list[Figure]:
    """Summary of all photos by one definition of the toe."""
    errors = np.abs([each.error_percent for each in found])
    sure = np.array([each.verdict == "trusted" for each in found])
    far = int((sure & (errors > FAR_PERCENT)).sum())
    typical = float(np.nanmedian(errors[sure])) if sure.any() else np.nan
    worst = float(np.nanmax(errors[sure])) if sure.any() else np.nan
    return [
        Figure(f"{toe}: photos", len(found), ""),
        Figure(f"{toe}: within 5 %", int((errors <= 5).sum()), "", needed),
        Figure(f"{toe}: median error of the mean width", float(np.nanmedian(errors)), "%", "<= 5"),
        Figure(f"{toe}: trusted", int(sure.sum()), "", needed),
        Figure(f"{toe}: median error of the trusted", typical, "%", "<= 5"),
        Figure(f"{toe}: trusted, off by more than {FAR_PERCENT} %", far, "", "<= 0"),
        Figure(f"{toe}: worst error of a trusted one", worst, "%"),
        Figure(
            f"{toe}: median correlation of the width along the bead",
            float(np.nanmedian([each.correlation for each in found])),
            "",
        ),
    ]


def table(found: list[Compared]) -> Iterator[str]:
    """A row per photo."""
    yield (
        f"{'photo':<14} {'toe':<6} {'human px':>8} {'ours px':>8} {'error %':>8} "
        f"{'confidence':>10} {'flagged %':>9} {'r':>6}  verdict"
    )
    for e in found:
        yield (
            f"{e.name:<14} {e.toe:<6} {e.human_px:>8.1f} {e.width_px:>8.1f} "
            f"{e.error_percent:>+8.1f} {e.confidence:>10.2f} {e.flagged_percent:>9.0f} "
            f"{e.correlation:>6.2f}  {e.verdict}"
        )


def main() -> None:
    """Measure all and tell."""
    chosen = options(__doc__)
    drawn = list(contours())
    for toe in TOES:
        found = [compare(contour, toe) for contour in drawn]
        if not found:
            sys.stderr.write("no photos with contours: set SEAMLOG_DATA\n")
            return
        if chosen.json:
            for each in found:
                row = vars(each) | {"error_percent": each.error_percent, "verdict": each.verdict}
                sys.stdout.write(json.dumps(row) + "\n")
        else:
            sys.stdout.write("\n" + "\n".join(table(found)) + "\n")
        tell(
            f"Toe: {toe}", figures_of(toe, found, f">= {round(len(found) * 12 / 17)}"), chosen.json
        )
    toe = next(iter(TOES))
    given = [compare(contour, toe, phase) for phase in PHASES for contour in drawn]
    title = f"{toe}, paths given"
    tell(f"Toe: {title}", figures_of(title, given), chosen.json)


if __name__ == "__main__":
    main()
