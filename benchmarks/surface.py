"""Around the width: spatter, flaws, calibration, gauge R&R and laser stripes, on known truth.

The drops that people marked on real photos come in where the data are (SEAMLOG_DATA).
"""

import json
import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from figures import Figure, options, tell
from numpy.typing import NDArray

from seamlog.analysis.bead.image import load_photo, make_photo
from seamlog.analysis.bead.measurement import TRUSTED
from seamlog.analysis.bead.part import measure_photo
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, render
from seamlog.analysis.calibration.board import Board
from seamlog.analysis.calibration.plane import Placing, calibrate_plane
from seamlog.analysis.calibration.synthetic import View, render_board
from seamlog.analysis.gauge.anova import gauge_rr
from seamlog.analysis.surface.candidates import find_candidates
from seamlog.analysis.surface.profile import profile_figures
from seamlog.analysis.surface.spatter import find_spatter, plate_mask
from seamlog.analysis.surface.stripe import find_stripe
from seamlog.analysis.surface.synthetic_flaws import KINDS, Flawed, flawed
from seamlog.analysis.surface.synthetic_spatter import Spattered, matched, spattered
from seamlog.analysis.surface.synthetic_stripe import (
    HEIGHT_MM,
    MM_PER_PX,
    ROW_OF_ZERO,
    UNDERCUT_MM,
    stripe_frame,
)
from seamlog.calibration import Lens, PlaneCalibration
from seamlog.errors import SeamlogError

PLAIN = Scene(noise=2)
TEXTURED = Scene(noise=2, texture=8, haz=35, gradient=0.4)
RIPPLED = Scene(noise=2, ripple=18, scallop_mm=0.12)
GLEAMING = Scene(noise=2, ripple=12, specular=1)
HARD = Scene(
    noise=3, blur_px=1.3, texture=8, haz=30, gradient=0.4, ripple=15, scallop_mm=0.1, specular=1,
    dark_toe=25, perspective=1,
)  # fmt: skip


def spatter_figures(seeds: int) -> list[Figure]:
    """F1 over seeds, 60 drops each, beside a plain adaptive threshold."""
    found = []
    cases = (("plain", PLAIN, ">= 0.95"), ("textured", TEXTURED, ">= 0.92"), ("hard", HARD, ""))
    for name, scene, target in cases:
        each = [spattered(scene, 60, seed) for seed in range(seeds)]
        ours = [_f1(case, *_ours(case)) for case in each]
        plain = [_f1(case, *_threshold(case)) for case in each]
        found += [
            Figure(f"spatter, {name}: F1", float(np.mean(ours)), "", target),
            Figure(f"spatter, {name}: least F1 of a seed", float(np.min(ours)), ""),
            Figure(f"spatter, {name}: adaptive threshold, F1", float(np.mean(plain)), ""),
        ]
    return found


def _ours(case: Spattered) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    blobs = find_spatter(case.photo, case.plane, case.bead).blobs
    return blobs.x_px, blobs.y_px


def _threshold(case: Spattered) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    grey = case.photo.as_bgr8()[..., 0]
    plate = plate_mask(case.photo, case.bead, 60.0)
    x, y = [], []
    for kind in (cv2.THRESH_BINARY, cv2.THRESH_BINARY_INV):
        offset = -12 if kind == cv2.THRESH_BINARY else 12
        marked = cv2.adaptiveThreshold(grey, 1, cv2.ADAPTIVE_THRESH_MEAN_C, kind, 31, offset)
        count, _, stats, centres = cv2.connectedComponentsWithStats(marked * plate)
        kept = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] >= 5]
        x += [centres[k, 0] for k in kept]
        y += [centres[k, 1] for k in kept]
    return np.array(x), np.array(y)


def _f1(case: Spattered, x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    return 2 * matched(x, y, case.drops) / (len(x) + len(case.drops))


def human_spatter_figures() -> list[Figure]:
    """Precision and recall against the polygons people drew around drops on the plate."""
    folder = Path(os.environ.get("SEAMLOG_DATA", "../shared/data")) / "bead_contours"
    marked = hit = found = good = photos = 0
    for path in sorted(folder.glob("*.jpg")):
        polygons = json.loads(path.with_suffix(".json").read_text()).get("spatter", [])
        photo = load_photo(path)
        try:
            bead = measure_strip(photo, plane_of(photo, None))
        except SeamlogError:
            continue
        if bead.confidence < TRUSTED:
            continue
        photos += 1
        blobs = find_spatter(photo, plane_of(photo, None), bead).blobs
        width_px = float(np.nanmedian(bead.width))
        plate = plate_mask(photo, bead, width_px)
        labels = np.zeros(plate.shape, np.int32)
        for number, polygon in enumerate(polygons, 1):
            cv2.fillPoly(labels, [np.array(polygon).astype(np.int32)], number)
        numbers = np.unique(labels[labels > 0]).tolist()
        on_plate = {k for k in numbers if plate[labels == k].mean() > 0.5}
        wide = cv2.dilate(labels.astype(np.float32), np.ones((5, 5))).astype(int)
        rows = np.clip(np.rint(blobs.y_px).astype(int), 0, plate.shape[0] - 1)
        columns = np.clip(np.rint(blobs.x_px).astype(int), 0, plate.shape[1] - 1)
        under = wide[rows, columns]
        marked, found = marked + len(on_plate), found + len(blobs)
        good, hit = good + int((under > 0).sum()), hit + len(on_plate & set(under.tolist()))
    if not marked:
        return []
    return [
        Figure("spatter, people's polygons: photos with a trusted bead", photos, ""),
        Figure("spatter, people's polygons: drops on the plate", marked, ""),
        Figure("spatter, people's polygons: recall", hit / marked, ""),
        Figure("spatter, people's polygons: precision", good / max(found, 1), ""),
    ]


def candidate_figures(seeds: int) -> list[Figure]:
    """Flaws that are among the candidates, two of each kind a photo, and strangers among them."""
    found = []
    scenes = {"plain": PLAIN, "rippled": RIPPLED, "gleaming": GLEAMING, "textured": TEXTURED,
              "hard": HARD}  # fmt: skip
    for name, scene in scenes.items():
        for dark in (55.0, 25.0):
            rates = _shown([flawed(scene, KINDS * 2, seed, dark) for seed in range(seeds)])
            label = f"candidates, {name}: {dark:.0f} grey levels"
            found += [Figure(f"{label}: {kind} shown", rate, "%") for kind, rate in rates.items()]
        sound = [flawed(scene, (), seed) for seed in range(seeds)]
        strange = [len(find_candidates(case.photo, case.plane, case.bead)) for case in sound]
        found.append(Figure(f"candidates, {name}: of a sound bead", float(np.mean(strange)), ""))
    return found


def _shown(cases: list[Flawed]) -> dict[str, float]:
    """Percent of the flaws of each kind that are among the candidates of their photo."""
    hits: dict[str, list[bool]] = {kind: [] for kind in KINDS}
    for case in cases:
        rows = find_candidates(case.photo, case.plane, case.bead)
        for flaw in case.flaws:
            mine = (row for row in rows if row.kind == flaw.kind)
            hits[flaw.kind].append(any(flaw.is_at(row.x_px, row.y_px) for row in mine))
    return {kind: 100 * float(np.mean(each)) for kind, each in hits.items()}


def real_candidate_figures() -> list[Figure]:
    """Candidates on real photos, about which nobody said what they are."""
    folder = Path(os.environ.get("SEAMLOG_DATA", "../shared/data")) / "bead_contours"
    counts = []
    for path in sorted(folder.glob("*.jpg")):
        photo = load_photo(path)
        plane = plane_of(photo, None)
        bead = measure_strip(photo, plane)
        if bead.trusted:
            counts.append(len(find_candidates(photo, plane, bead)))
    if not counts:
        return []
    return [
        Figure("candidates on trusted real photos, mean", float(np.mean(counts)), ""),
        Figure("candidates on trusted real photos, most", max(counts), ""),
    ]


def calibration_figures(seeds: int) -> list[Figure]:
    """Errors of 6 mm through a lens with distortion, one photo of a board."""
    found = []
    boards = (("chessboard", Board(14, 10, 8.0)), ("ChArUco", Board(14, 10, 8.0, 6.0)))
    boards = (boards[0], ("ChArUco", replace(boards[1][1], dictionary="DICT_5X5_100")))
    for name, board in boards:
        errors = []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            lens = Lens(
                focal_x_px=1500, focal_y_px=1500, centre_x_px=639.5 + rng.uniform(-15, 15),
                centre_y_px=479.5 + rng.uniform(-15, 15),
                distortion=(rng.uniform(-0.25, 0.1), 0.05, 3e-4, -3e-4, 0.0),
            )  # fmt: skip
            tilt = (float(rng.uniform(-8, 8)), float(rng.uniform(-8, 8)))
            view = View(lens, 1280, 960, 150.0, tilt, float(rng.uniform(-5, 5)), noise=2.0)
            photo, truth = render_board(board, view, seed)
            errors.append(_six_mm_um(calibrate_plane(photo, board, Placing()), truth, rng))
        found += [
            Figure(f"6 mm, {name}: rms error", float(np.mean(errors)), "um", "<= 2"),
            Figure(f"6 mm, {name}: worst photo", float(np.max(errors)), "um"),
        ]
    return found


def _six_mm_um(found: PlaneCalibration, truth: PlaneCalibration, rng: np.random.Generator) -> float:
    start = rng.uniform((160, 120), (1120, 840), (400, 2))
    angle = rng.uniform(0, 2 * np.pi, 400)
    away = 6 * np.column_stack([np.cos(angle), np.sin(angle)])
    stop = truth.px(truth.plane_mm(start) + away)
    apart = np.hypot(*(found.plane_mm(start) - found.plane_mm(stop)).T)
    return float(1e3 * np.sqrt(np.mean((apart - 6) ** 2)))


def gauge_figures(parts: int) -> list[Figure]:
    """10 beads x 3 camera places x 3 photos: widths 6 mm +- 0.3 mm, SNR 20."""
    values = np.empty((parts, 3, 3))
    rng = np.random.default_rng(1)
    for part in range(parts):
        half = 3 + 0.15 * float(rng.standard_normal())
        for operator, lean in enumerate((0.0, 0.5, 1.0)):
            scene = Scene(half_width_mm=half, ripple=8, perspective=lean, gradient=0.1 * operator)
            bead = render(scene, part)
            for trial in range(3):
                noisy = bead.pixels + rng.normal(0, 4, bead.pixels.shape)
                photo = make_photo(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), "bead")
                even = measure_photo(photo, bead.calibration).uniformity
                assert even is not None
                values[part, operator, trial] = even.mean
    found = gauge_rr(values)
    return [
        Figure("gauge: %GRR", found.percent_grr, "%", "<= 8"),
        Figure("gauge: distinct categories", found.categories, "", ">= 5"),
        Figure("gauge: repeatability EV", 1e3 * found.repeatability, "um"),
        Figure("gauge: reproducibility AV", 1e3 * found.reproducibility, "um"),
    ]


def stripe_figures(seeds: int) -> list[Figure]:
    """Place of a stripe with specular ghosts, beside the centroid of each column."""
    ours, centroid, height, undercut = [], [], [], []
    for seed in range(seeds):
        frame, true_row = stripe_frame(seed)
        found = find_stripe(frame)
        row = found.px[:, 1]
        ours.append(_rms_um((row - true_row)[found.seen]))
        above = np.clip(frame.astype(np.float64) - 30, 0, None) + 1e-9
        middle = (above * np.arange(frame.shape[0])[:, None]).sum(axis=0) / above.sum(axis=0)
        centroid.append(_rms_um(middle - true_row))
        x_mm = (np.arange(frame.shape[1]) - frame.shape[1] / 2) * MM_PER_PX
        z_mm = (ROW_OF_ZERO * frame.shape[0] - row) * MM_PER_PX
        figures = profile_figures(np.where(found.seen, x_mm, np.nan), z_mm)
        height.append(figures.height_mm - HEIGHT_MM)
        undercut.append(figures.undercut_mm - UNDERCUT_MM)
    return [
        Figure(
            "stripe with ghosts: rms error, median frame", float(np.median(ours)), "um", "<= 19"
        ),
        Figure("stripe with ghosts: rms error, worst frame", float(np.max(ours)), "um"),
        Figure("stripe with ghosts: centroid, median frame", float(np.median(centroid)), "um"),
        Figure("stripe with ghosts: height, rms error", 1e3 * _rms(height), "um"),
        Figure("stripe with ghosts: undercut, rms error", 1e3 * _rms(undercut), "um"),
    ]


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _rms_um(error_px: NDArray[np.float64]) -> float:
    return float(1e3 * MM_PER_PX * np.sqrt(np.mean(error_px**2)))


if __name__ == "__main__":
    given = options(__doc__)
    seeds = 2 if given.quick else 10
    tell("Spatter", spatter_figures(seeds) + human_spatter_figures(), given.json)
    tell("Candidates", candidate_figures(seeds) + real_candidate_figures(), given.json)
    tell("Calibration", calibration_figures(seeds), given.json)
    tell("Gauge R&R", gauge_figures(4 if given.quick else 10), given.json)
    tell("Laser stripe", stripe_figures(2 * seeds), given.json)
