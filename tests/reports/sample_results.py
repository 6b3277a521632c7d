"""Results of an invented weld, written through the core as analysis writes them.

`python -m tests.reports.sample_results FOLDER` writes them for a person to look at.
"""

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from seamlog.results import (
    Criterion,
    Figure,
    Finding,
    Input,
    Part,
    Picture,
    Place,
    Results,
    Severity,
    Verdict,
)

START_NS = 1_767_225_600_000_000_000
WELD_START_S = 30.0
SLOW_S_MM = 120.0
OFFSET_MM = 3.0
"""The photo's arc length begins half a width before the place of arc on."""
Floats = NDArray[np.float64]
SESSION = Input(name="weld.mcap", sha256="5e" * 32, bytes=18_304_112)
PHOTO = Input(name="weld.bead.jpg", sha256="b0" * 32, bytes=912_004)


def write_sample(folder: Path, seed: int = 1) -> Results:
    """A whole analysis: health, tracking, seam, identification, replay, bead and join."""
    results = Results.create(folder)
    random = np.random.default_rng(seed)
    weld = _weld(random)
    _write_health(results)
    _write_tracking(results, weld)
    _write_seam(results)
    _write_identification(results, random)
    _write_replay(results, weld, random)
    _write_bead(results, weld, random)
    _write_join(results, weld)
    return results


def stamps(seconds: Floats) -> NDArray[np.int64]:
    return START_NS + np.rint(seconds * 1e9).astype(np.int64)


def _weld(random: np.random.Generator) -> dict[str, Floats]:
    """The weld at 25 Hz: a dip of the weld speed near SLOW_S_MM widens the bead."""
    t = np.arange(0.0, 34.0, 0.04)
    speed = 6.0 - 2.4 * np.exp(-(((t - 20.5) / 1.2) ** 2))
    s_mm = np.concatenate(([0.0], np.cumsum(speed[:-1] * 0.04)))
    reference = 9 * np.sin(2 * np.pi * s_mm / 140)
    error = 0.25 * np.sin(1.7 * t) + random.normal(0, 0.05, t.size)
    width = 6.0 * np.sqrt(6.0 / speed) + 0.6 * np.abs(error)
    command = np.round(2.0 * np.gradient(reference, t) + random.normal(0, 0.3, t.size), 3)
    columns = {"t": t, "speed": speed, "s_mm": s_mm, "reference": reference, "error": error}
    return columns | {"width": width, "command": command}


def _figure(name: str, label: str, value: Any, unit: str = "", u: float | None = None) -> Figure:
    return Figure(name=name, label=label, value=value, unit=unit, u=u)


def _write_health(results: Results) -> None:
    channels = {
        "topic": np.array(["/table/encoder", "/events"], dtype=object),
        "count": np.array([1350, 4]),
        "period_s": np.array([0.04, np.nan]),
    }
    results.write(
        Part(
            part="health",
            title="Recording health",
            inputs=[SESSION],
            verdict=Verdict.PASS,
            reason="no message lost, no gap longer than 2.1 periods",
            figures=[
                _figure("messages", "Messages", 10_431),
                _figure("dropped", "Messages dropped", 0),
                _figure("longest_gap_ms", "Longest gap", 84.0, "ms"),
            ],
            criteria=[
                Criterion(
                    name="dropped",
                    label="Messages dropped",
                    value=0,
                    upper=0,
                    verdict=Verdict.PASS,
                )
            ],
            details={
                "end_ns": int(stamps(np.array([WELD_START_S + 34.0]))[0]),
                "metadata": {"wps": "WPS-135-07", "material": "S235JR", "process": "135 (MAG)"},
            },
        ),
        tables={"channels": (channels, {"period_s": "s"})},
    )


def _write_tracking(results: Results, weld: dict[str, Floats]) -> None:
    stamp_ns = stamps(WELD_START_S + weld["t"])
    error = {
        "stamp_ns": stamp_ns,
        "reference_mm": weld["reference"],
        "measurement_mm": np.round(weld["reference"] - weld["error"], 3),
        "error_mm": weld["error"],
        "command": weld["command"],
    }
    units = {"reference_mm": "mm", "measurement_mm": "mm", "error_mm": "mm", "command": "N"}
    speed = {"stamp_ns": stamp_ns, "weld_speed_mm_s": weld["speed"]}
    rms = float(np.sqrt(np.mean(weld["error"] ** 2)))
    results.write(
        Part(
            part="tracking",
            title="Tracking",
            inputs=[SESSION],
            verdict=Verdict.NOT_ASSESSED,
            reason="no limit on the tracking error was given",
            figures=[
                _figure("rms_error_mm", "rms tracking error", rms, "mm", 0.004),
                _figure("peak_error_mm", "peak tracking error", 0.412, "mm", 0.02),
            ],
        ),
        tables={"error": (error, units), "speed": (speed, {"weld_speed_mm_s": "mm/s"})},
    )


def _write_seam(results: Results) -> None:
    stamp_ns = stamps(WELD_START_S + np.arange(0.0, 34.0, 0.1))
    points = {"stamp_ns": stamp_ns, "seam_points": np.full(stamp_ns.size, 44)}
    results.write(
        Part(
            part="seam",
            title="Seam and path",
            inputs=[SESSION],
            figures=[_figure("pictures", "camera pictures", 340)],
        ),
        tables={"vision": (points, {})},
        pictures={f"frame{i}": _frame(i) for i in range(0, 34, 4)},
    )


def _frame(second: int) -> tuple[bytes, Picture]:
    image = np.full((120, 160, 3), 40 + 4 * second, np.uint8)
    cv2.line(image, (40 + second, 0), (120 - second, 119), (210, 220, 230), 3)
    data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, 60])[1].tobytes()
    time_ns = START_NS + round((WELD_START_S + second) * 1e9)
    picture = Picture(
        file="frame.webp",
        caption="Camera in front of the torch",
        width_px=160,
        height_px=120,
        sha256="",
        time_ns=time_ns,
    )
    return data, picture


def _write_identification(results: Results, random: np.random.Generator) -> None:
    t = np.arange(0.0, 20.0, 0.04)
    settle = 1 - np.exp(-t / 3)
    estimator = {
        "stamp_ns": stamps(t),
        "inertia": 1.02 * settle + random.normal(0, 0.01, t.size),
        "viscous_friction": 2.14 * settle + random.normal(0, 0.02, t.size),
        "coulomb_friction": 0.214 * settle + random.normal(0, 0.004, t.size),
        "u_inertia": 0.02 + 30 * np.exp(-t / 0.3),
    }
    units = {"inertia": "N s^2/m", "viscous_friction": "N s/m", "coulomb_friction": "N"}
    gap = np.where((t > 8) & (t < 9), np.nan, random.normal(0, 0.02, t.size))
    residual = {"stamp_ns": stamps(t), "residual": gap}
    results.write(
        Part(
            part="identification",
            title="Identification",
            inputs=[SESSION],
            verdict=Verdict.NOT_ASSESSED,
            reason="no reference values were given",
            configuration={"method": "idim_ls", "cutoff_hz": 5.0},
            figures=[
                _figure("inertia", "Inertia", 1.0213, "N s^2/m", 0.0041),
                _figure("viscous_friction", "Viscous friction", 2.137, "N s/m", 0.021),
                _figure("coulomb_friction", "Coulomb friction", 0.2142, "N", 0.0032),
                Figure(
                    name="offset",
                    label="Offset",
                    value=None,
                    unit="N",
                    reason="the motion is symmetric: offset cannot be told from gravity",
                ),
            ],
            details={
                "comparison": [
                    {
                        "name": "inertia",
                        "identified": 1.0213,
                        "identified_sd": 0.0041,
                        "published": 1.0,
                        "published_sd": None,
                        "difference_sd": 5.2,
                    }
                ]
            },
        ),
        tables={"estimator": (estimator, units), "residual": (residual, {"residual": "N"})},
    )


def _write_replay(results: Results, weld: dict[str, Floats], random: np.random.Generator) -> None:
    stamp_ns = stamps(WELD_START_S + weld["t"])
    tables, figures = {}, []
    for name, size in (("recorded", 1.0), ("paper", 0.9), ("pd", 2.4)):
        error = size * weld["error"] + random.normal(0, 0.02, weld["t"].size)
        command = size * weld["command"]
        columns = {"stamp_ns": stamp_ns, "error_mm": error, "command": command}
        if name != "recorded":
            columns |= {"band_low_mm": error - 0.1, "band_high_mm": error + 0.1}
        tables[name] = (columns, dict.fromkeys(list(columns)[1:], "mm") | {"command": "N"})
        rms, peak = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        figures += [
            _figure(f"{name}_rms_error_mm", f"rms tracking error, {name}", rms, "mm", 0.01),
            _figure(f"{name}_peak_error_mm", f"peak tracking error, {name}", peak, "mm", 0.03),
        ]
    results.write(
        Part(part="replay", title="Replay", inputs=[SESSION], figures=figures), tables=tables
    )


def _write_bead(results: Results, weld: dict[str, Floats], random: np.random.Generator) -> None:
    s_mm = np.arange(1.0, 195.0, 0.25)
    width = np.interp(s_mm - OFFSET_MM, weld["s_mm"], weld["width"]) + random.normal(
        0, 0.03, s_mm.size
    )
    width[300:308] = np.nan
    flagged = np.zeros(s_mm.size, dtype=np.bool_)
    flagged[500:506] = True
    centre = 120 + 90 * np.sin(2 * np.pi * s_mm / 140)
    x_px = 40 + 10 * s_mm
    stations = {"s_mm": s_mm, "width_mm": width, "u_width_mm": np.full(s_mm.size, 0.06)}
    stations |= {"flagged": flagged}
    half = 5 * np.where(np.isfinite(width), width, 6.0)
    toes = {"left_x_px": x_px, "left_y_px": centre - half + 80}
    toes |= {"right_x_px": x_px, "right_y_px": centre + half + 80}
    units = {"s_mm": "mm", "width_mm": "mm", "u_width_mm": "mm"} | dict.fromkeys(toes, "px")
    widest = float(np.nanmax(width))
    results.write(
        Part(
            part="bead",
            title="Bead",
            inputs=[PHOTO],
            verdict=Verdict.FAIL,
            reason="the widest place is above the limit",
            figures=[
                _figure("width_mean_mm", "Mean width", float(np.nanmean(width)), "mm", 0.04),
                _figure("width_std_mm", "Width, standard deviation", float(np.nanstd(width)), "mm"),
                _figure("width_range_mm", "Range of the width", 1.9, "mm", 0.08),
            ],
            criteria=[
                Criterion(
                    name="width",
                    label="Width at every station",
                    value=widest,
                    unit="mm",
                    u=0.06,
                    lower=5.5,
                    upper=7.5,
                    verdict=Verdict.FAIL,
                    place=Place(s_mm=SLOW_S_MM + OFFSET_MM, weld=1),
                )
            ],
            details={
                "photo_width_px": 2030,
                "photo_height_px": 420,
                "calibration": "weld.bead.calibration.json, scale, u = 0.35 %",
            },
            weld=1,
        ),
        tables={"stations": (stations | toes, units)},
        pictures={"overlay": _photo(x_px, stations, toes)},
    )


def _photo(
    x_px: Floats, stations: dict[str, Floats], toes: dict[str, Floats]
) -> tuple[bytes, Picture]:
    image = np.full((420, 2030, 3), (92, 90, 88), np.uint8)
    noise = np.random.default_rng(3).normal(0, 6, image.shape[:2])
    left = np.column_stack([x_px, toes["left_y_px"]])
    right = np.column_stack([x_px, toes["right_y_px"]])
    outline = np.concatenate([left, right[::-1]]).astype(np.int32)
    cv2.fillPoly(image, [outline], (168, 170, 172))
    image = np.clip(image + noise[..., None], 0, 255).astype(np.uint8)
    for edge in (left, right):
        cv2.polylines(image, [edge.astype(np.int32)], False, (40, 160, 255), 2)
    half = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    data = cv2.imencode(".webp", half, [cv2.IMWRITE_WEBP_QUALITY, 80])[1].tobytes()
    caption = "Bead from above with the toes as measured; start of the weld on the left."
    picture = Picture(file="overlay.webp", caption=caption, width_px=1015, height_px=210, sha256="")
    return data, picture


def _write_join(results: Results, weld: dict[str, Floats]) -> None:
    every = slice(0, None, 2)
    columns = {
        "s_mm": weld["s_mm"][every],
        "stamp_ns": stamps(WELD_START_S + weld["t"][every]),
        "width_mm": weld["width"][every],
        "u_width_mm": np.full(weld["t"][every].size, 0.06),
        "speed_mm_s": weld["speed"][every],
        "error_mm": weld["error"][every],
        "command": weld["command"][every],
        "current_a": 180 + 2 * np.sin(weld["t"][every]),
        "voltage_v": 22 + 0.2 * np.cos(weld["t"][every]),
    }
    columns["heat_kj_mm"] = (
        0.8 * columns["current_a"] * columns["voltage_v"] / columns["speed_mm_s"] / 1000
    )
    units = {
        "s_mm": "mm",
        "stamp_ns": "ns",
        "width_mm": "mm",
        "u_width_mm": "mm",
        "speed_mm_s": "mm/s",
        "error_mm": "mm",
        "command": "N",
        "current_a": "A",
        "voltage_v": "V",
        "heat_kj_mm": "kJ/mm",
    }
    time_ns = int(stamps(np.array([WELD_START_S + 20.5]))[0])
    message = (
        "The bead is 1.7 mm wider than its mean from 114 to 126 mm: the weld speed fell from 6.0 "
        "to 3.6 mm/s there; tracking error and command were as elsewhere."
    )
    results.write(
        Part(
            part="join",
            title="Join of bead and log",
            inputs=[SESSION, PHOTO],
            verdict=Verdict.NOT_ASSESSED,
            reason="a join is not judged",
            weld=1,
            findings=[
                Finding(
                    severity=Severity.WARNING,
                    message=message,
                    place=Place(s_mm=SLOW_S_MM, time_ns=time_ns, weld=1),
                )
            ],
            details={
                "offset_mm": OFFSET_MM,
                "causes": [
                    {
                        "channel": "weld_speed",
                        "s_mm": SLOW_S_MM,
                        "ranking": [{"channel": "weld_speed", "correlation": -0.96}],
                    }
                ],
            },
        ),
        tables={"stations": (columns, units)},
    )


if __name__ == "__main__":
    write_sample(Path(sys.argv[1]))
