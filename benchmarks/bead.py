"""Bead width on rendered photos with exact truth, and its speed beside peers.

Cases, stations and path prior as in `seamlog.analysis.bead.synthetic`; errors in px of 0.1 mm.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from figures import Figure, cpu_s, optional_peer, options, tell

from seamlog.analysis.bead.image import Photo, make_photo
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane, plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import CASES, SyntheticBead, render
from seamlog.analysis.bead.uniformity import uniformity

RMS_PX = {
    "clean": 0.03,
    "snr 20": 0.065,
    "snr 5": 0.25,
    "blur 3": 0.15,
    "dark toe": 0.3,
    "specular": 0.5,
    "hard": 0.5,
}
COVERAGE = {"snr 20": 93, "snr 5": 93, "blur 3": 93, "hard": 90}
UNEVEN = {"snr 20": 5, "snr 5": 5, "blur 3": 5, "hard": 8}
BIG = replace(CASES["hard"], width_px=4096, height_px=2048, mm_per_px=0.025)


def measured(bead: SyntheticBead, name: str, seed: int) -> tuple[Plane, BeadMeasurement]:
    """The bead measured along a path that wanders around the true one."""
    photo = make_photo(bead.pixels, name)
    plane = plane_of(photo, bead.calibration)
    return plane, measure_strip(photo, plane, bead.wandering_path(seed=seed))


def case(name: str, seeds: int) -> Iterator[Figure]:
    """Accuracy, coverage, losses and flags of one case over all seeds."""
    errors, covered, flagged, silent, uneven = [], [], [], 0, []
    for seed in range(seeds):
        bead = render(CASES[name], seed)
        plane, m = measured(bead, name, seed)
        centre_mm = plane.to_plane(m.centre_px)
        inside = (centre_mm[:, 0] > 3) & (centre_mm[:, 0] < 99.4)
        true_mm = bead.width_at_mm(bead.seam_s_mm(centre_mm))
        error = (m.width - true_mm) / 0.1
        kept = inside & (np.abs(error) <= 5)
        errors.append(error[kept])
        covered.append(np.abs(error[kept]) <= 19.6 * m.u_width[kept])
        flagged.append(~m.good[inside])
        silent += int((inside & ~kept & m.good).sum())
        even = uniformity(m)
        if even is not None:
            uneven.append(abs(even.std / np.std(true_mm[m.good]) - 1))
    rms = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    limit = f"<= {RMS_PX[name]}" if name in RMS_PX else ""
    yield Figure(f"{name}: width error, rms", rms, "px", limit)
    share = 100 * float(np.mean(np.concatenate(covered)))
    limit = f">= {COVERAGE[name]}" if name in COVERAGE else ""
    yield Figure(f"{name}: within 1.96 u", share, "%", limit)
    yield Figure(f"{name}: lost without a flag", silent, "", "<= 0")
    yield Figure(f"{name}: flagged", 100 * float(np.mean(np.concatenate(flagged))), "%", "<= 2")
    limit = f"<= {UNEVEN[name]}" if name in UNEVEN else ""
    yield Figure(f"{name}: unevenness, worst seed", 100 * max(uneven), "%", limit)


def skeleton(photo: Photo) -> None:
    """Otsu's threshold, skeleton, distance transform: the usual width of a mask."""
    from skimage.morphology import skeletonize

    smooth = cv2.GaussianBlur(photo.pixels, (5, 5), 0)
    mask = cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)[1]
    cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    skeletonize(mask > 0)


def speed(quick: bool) -> Iterator[Figure]:
    """CPU time with a path prior, one thread, from the decoded picture on."""
    cv2.setNumThreads(1)
    scene = replace(BIG, width_px=2048, height_px=1024, mm_per_px=0.05) if quick else BIG
    bead = render(scene, 10)
    photo = make_photo(bead.pixels, "big")
    plane, path = plane_of(photo, bead.calibration), bead.wandering_path(seed=1)
    megapixels = photo.width_px * photo.height_px / 1e6
    own = cpu_s(lambda: measure_strip(photo, plane, path)) / megapixels
    yield Figure(f"{megapixels:.1f} MP with a path prior", 1e3 * own, "ms/MP", "<= 4")
    with optional_peer("scikit-image"):
        peer = cpu_s(lambda: skeleton(photo), 1) / megapixels
        yield Figure("skeleton + distance transform / ours", peer / own, "x", ">= 15")


def main() -> None:
    """Run all and tell."""
    chosen = options(__doc__)
    figures: list[Figure] = []
    for name in CASES:
        sys.stderr.write(f"{name}\n")
        figures += case(name, 2 if chosen.quick else 10)
    figures += speed(chosen.quick)
    tell("bead: rendered photos with exact truth", figures, chosen.json)


if __name__ == "__main__":
    main()
