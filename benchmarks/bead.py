"""Bead width on rendered photos with exact truth, beside its peers and the limit of any estimator.

Cases, stations and path prior as in `seamlog.analysis.bead.synthetic`; errors in px of 0.1 mm.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from bead_peers import PEERS, mask_of, score, subpixel_points
from figures import Figure, cpu_s, optional_peer, options, tell

from seamlog.analysis.bead.image import Photo, decode_photo, make_photo
from seamlog.analysis.bead.loops import as_machine_code
from seamlog.analysis.bead.measurement import BeadMeasurement
from seamlog.analysis.bead.plane import Plane, plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import CASES, Scene, SyntheticBead, render
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
COVERAGE = {"snr 20": (93, 97), "snr 5": (93, 97), "blur 3": (93, 97), "hard": (90, 100)}
LIMIT = {"snr 20": 1.15, "snr 5": 1.15, "blur 3": 1.3}
"""How many times the Cramer-Rao limit the error may be."""
ROWS = 8
"""Rows that the limit averages over; seamlog's own averaging is longer in these cases."""
BESIDE = ("clean", "snr 20", "snr 5", "blur 3", "dark toe", "specular", "hard")
"""Cases that peers are tried on."""
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
    if name in LIMIT:
        ratio = rms / cramer_rao_px(CASES[name])
        yield Figure(f"{name}: error / Cramer-Rao", ratio, "x", f"<= {LIMIT[name]}")
    share = 100 * float(np.mean(np.concatenate(covered)))
    least, most = COVERAGE.get(name, (None, None))
    yield Figure(f"{name}: within 1.96 u", share, "%", f">= {least}" if least else "")
    if most and most < 100:
        yield Figure(f"{name}: within 1.96 u, at most", share, "%", f"<= {most}")
    yield Figure(f"{name}: lost without a flag", silent, "", "<= 0")
    yield Figure(f"{name}: flagged", 100 * float(np.mean(np.concatenate(flagged))), "%", "<= 2")
    limit = f"<= {UNEVEN[name]}" if name in UNEVEN else ""
    yield Figure(f"{name}: unevenness, worst seed", 100 * max(uneven), "%", limit)


def cramer_rao_px(scene: Scene) -> float:
    """Least error of a width from `ROWS` rows with flat, known steps; a pixel blurs as well."""
    blur = np.sqrt(scene.blur_px**2 + 1 / 12)
    one_toe = scene.noise / scene.contrast * np.sqrt(2 * np.sqrt(np.pi) * blur)
    return float(one_toe * np.sqrt(2 / ROWS))


def peers(name: str, seeds: int) -> Iterator[Figure]:
    """Accuracy of the peers, which are told where the true seam is."""
    beads = [render(CASES[name], seed) for seed in range(seeds)]
    for label, measure in PEERS.items():
        with optional_peer(label):
            scores = []
            for bead in beads:
                plane = plane_of(make_photo(bead.pixels, name), bead.calibration)
                scores.append(score(bead, measure(bead, plane)))
            errors = np.concatenate([kept for kept, _ in scores])
            rms = float(np.sqrt(np.mean(errors**2))) if len(errors) else float("nan")
            yield Figure(f"{name}: {label}, rms", rms, "px")
            lost = 100 * float(np.mean([part for _, part in scores]))
            yield Figure(f"{name}: {label}, lost", lost, "%")


def skeleton(photo: Photo) -> None:
    """Otsu's threshold, skeleton, distance transform: the usual width of a mask."""
    from skimage.morphology import skeletonize

    mask = mask_of(photo.pixels)
    cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    skeletonize(mask > 0)


LOADING = """
import time
from seamlog.analysis.bead.image import make_photo
from seamlog.analysis.bead.loops import as_machine_code
from seamlog.analysis.bead.plane import plane_of
from seamlog.analysis.bead.strip import measure_strip
from seamlog.analysis.bead.synthetic import Scene, render

bead = render(Scene(width_px=640, height_px=360, perspective=1), 1)
photo, path = make_photo(bead.pixels, "small"), bead.wandering_path(seed=1)
plane = plane_of(photo, bead.calibration)
measure_strip(photo, plane, path)
start = time.process_time()
with as_machine_code():
    measure_strip(photo, plane, path)
loaded = time.process_time()
measure_strip(photo, plane, path)
print(loaded - start - (time.process_time() - loaded))
"""


def loading_s() -> float:
    """CPU time that the machine code's first use in a process costs, when it is in the cache."""
    run = [sys.executable, "-c", LOADING]
    return float(subprocess.run(run, capture_output=True, check=True, text=True).stdout)


def speed(quick: bool) -> Iterator[Figure]:
    """CPU time with a path prior, one thread, from the decoded picture on."""
    cv2.setNumThreads(1)
    scene = replace(BIG, width_px=2048, height_px=1024, mm_per_px=0.05) if quick else BIG
    bead = render(scene, 10)
    # decoded, as photos are: what a decoder frees decides how much memory is kept at hand
    photo = decode_photo(cv2.imencode(".png", bead.pixels)[1].tobytes(), "big")
    plane, path = plane_of(photo, bead.calibration), bead.wandering_path(seed=1)
    megapixels = photo.width_px * photo.height_px / 1e6

    def measure() -> None:
        measure_strip(make_photo(photo.pixels, "big"), plane, path)

    plain = cpu_s(measure, 15) / megapixels
    yield Figure(f"{megapixels:.1f} MP with a path prior", 1e3 * plain, "ms/MP", "<= 4")
    with as_machine_code():
        own = cpu_s(measure, 15) / megapixels
    yield Figure("the same with the extra `fast`", 1e3 * own, "ms/MP", "<= 4")
    yield Figure("to load numba and the machine code, in a new process", loading_s(), "s")
    with optional_peer("scikit-image"):
        peer = cpu_s(lambda: skeleton(photo), 1) / megapixels
        yield Figure("skeleton + distance transform / ours", peer / plain, "x", ">= 15")
    with optional_peer("subpixel-edges"):
        subpixel_points(photo.pixels[:64, :64])
        peer = cpu_s(lambda: subpixel_points(photo.pixels), 3) / megapixels
        yield Figure("subpixel-edges / ours", peer / plain, "x")
        yield Figure("subpixel-edges / ours with the extra `fast`", peer / own, "x", ">= 200")


def main() -> None:
    """Run all and tell."""
    chosen = options(__doc__)
    figures: list[Figure] = []
    for name in CASES:
        sys.stderr.write(f"{name}\n")
        figures += case(name, 2 if chosen.quick else 10)
    for name in BESIDE:
        sys.stderr.write(f"peers: {name}\n")
        figures += peers(name, 1 if chosen.quick else 3)
    figures += speed(chosen.quick)
    tell("bead: rendered photos with exact truth", figures, chosen.json)


if __name__ == "__main__":
    main()
