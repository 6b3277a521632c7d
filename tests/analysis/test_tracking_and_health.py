"""Tracking, torch path and health of sessions whose truth is known."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.health import clock_steps, health_part
from seamlog.analysis.torch_path import path_of
from seamlog.analysis.tracking import TrackingLimits, tracking_parts
from seamlog.cli import run
from seamlog.results import Results, Verdict
from seamlog.session import open_session

MakeLoop = Callable[..., AxisRecord]
SessionOf = Callable[..., Path]
NS = 1_000_000_000


def test_error_is_reference_minus_measurement(loop: MakeLoop, session_of: SessionOf) -> None:
    record = loop()
    shifted = replace(record, reference_m=record.position_m + 0.002)
    with open_session(session_of(shifted)) as session:
        [(part, tables)] = tracking_parts(session, [], TrackingLimits())
    figures = {figure.name: figure.value for figure in part.figures}
    assert figures["rms_error_mm"] == pytest.approx(2.0)
    assert figures["mean_error_mm"] == pytest.approx(2.0)
    np.testing.assert_allclose(tables["error"][0]["error_mm"], 2.0)
    assert part.verdict is Verdict.NOT_ASSESSED
    assert figures["mean_weld_speed_mm_s"] is None


@pytest.mark.parametrize(("limit_mm", "verdict", "code"), [(50.0, "PASS", 0), (0.1, "FAIL", 1)])
def test_a_limit_is_judged(
    loop: MakeLoop,
    session_of: SessionOf,
    tmp_path: Path,
    limit_mm: float,
    verdict: str,
    code: int,
) -> None:
    path, results = session_of(loop()), tmp_path / "r"
    limit = ["--set", f"limits.tracking_error_mm={limit_mm}"]
    assert run(["analyze", str(path), "-o", str(results), *limit]) == code
    part = next(part for part in Results.open(results).parts() if part.part == "tracking")
    assert part.verdict == verdict
    assert part.criteria[0].place is not None and part.criteria[0].place.time_ns is not None


def test_results_that_are_there_are_kept(
    loop: MakeLoop, session_of: SessionOf, tmp_path: Path
) -> None:
    path, results = session_of(loop()), tmp_path / "r"
    assert run(["analyze", str(path), "-o", str(results)]) == 0
    assert run(["analyze", str(path), "-o", str(results)]) == 2
    assert run(["analyze", str(path), "-o", str(results), "--force"]) == 0


def test_a_session_that_cannot_tell_the_axis_still_has_results(
    loop: MakeLoop, session_of: SessionOf, tmp_path: Path
) -> None:
    record = loop()
    still = replace(
        record,
        position_m=np.zeros(len(record)),
        velocity_m_s=np.zeros(len(record)),
    )
    assert run(["analyze", str(session_of(still)), "-o", str(tmp_path / "r")]) == 0
    parts = {part.part: part for part in Results.open(tmp_path / "r").parts()}
    figure = parts["identification"].figure("coulomb_friction")
    assert figure is not None and figure.value is None and "to and fro" in figure.reason


def test_a_gap_is_found_where_it_is(loop: MakeLoop, session_of: SessionOf) -> None:
    record = loop()
    kept = np.ones(len(record), dtype=np.bool_)
    kept[200:210] = False
    with open_session(session_of(record.rows(kept))) as session:
        part, tables = health_part(session)
    gaps = [finding for finding in part.findings if "no message for" in finding.message]
    assert len(gaps) == 3
    assert all("0.440 s" in gap.message for gap in gaps)
    place = gaps[0].place
    assert place is not None and place.time_ns == record.log_time_ns[199]
    dropped = part.figure("dropped")
    assert dropped is not None and dropped.value is None
    assert tables["channels"][0]["gaps"].tolist() == [1, 1, 1]


def test_a_step_of_the_clock_is_told_from_jitter() -> None:
    random = np.random.default_rng(0)
    log_time = np.arange(100) * 100_000_000
    jitter = random.normal(0, 5e6, 100).astype(np.int64)
    stamps = log_time - 20_000_000 + jitter
    assert clock_steps(stamps, log_time) == []
    late = stamps.copy()
    late[40] -= 300_000_000
    assert clock_steps(late, log_time) == []
    late[60:] += 350_000_000
    [(time_ns, jump_s)] = clock_steps(late, log_time)
    assert time_ns == log_time[60]
    assert jump_s == pytest.approx(0.35, abs=0.02)


def torch(noise_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Stamps, positions on the plate, true arc length and true speed of a weld with a dip."""
    seconds = 0.1 * np.arange(335)
    travel = 6 - 2.4 * np.exp(-(((seconds - 20) / 1.0) ** 2))
    y = np.concatenate([[0.0], np.cumsum(0.05 * (travel[1:] + travel[:-1]))])
    x = 8 * np.sin(y / 40)
    noise = np.random.default_rng(2).normal(0, noise_mm, (2, len(y)))
    s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    speed = travel * np.hypot(1.0, 0.2 * np.cos(y / 40))
    return (seconds * NS).astype(np.int64), np.column_stack([x, y]) + noise.T, s, speed


@pytest.mark.parametrize("noise_mm", [0.0, 0.15])
def test_the_torch_path_is_arc_length_and_speed(noise_mm: float) -> None:
    stamp_ns, plate_mm, s_mm, speed_mm_s = torch(noise_mm)
    path = path_of(stamp_ns, plate_mm, (int(stamp_ns[0]), int(stamp_ns[-1])), 0.002)
    assert np.max(np.abs(path.at(stamp_ns) - s_mm)) < 0.1 + 5 * noise_mm
    assert np.std(path.speed_at(stamp_ns) - speed_mm_s) < 0.1 + noise_mm
    slowest = path.s_mm[np.argmin(path.speed_mm_s)]
    assert slowest == pytest.approx(s_mm[np.argmin(speed_mm_s)], abs=4.0)
    back = path.stamp_at(path.s_mm[5:-5])
    assert np.max(np.abs(back - path.stamp_ns[5:-5])) < 20_000_000


def test_a_wild_marker_does_not_bend_the_torch_path() -> None:
    stamp_ns, plate_mm, s_mm, _ = torch(0.1)
    wild = plate_mm.copy()
    wild[[60, 150, 151]] += 40.0
    wild[222] = np.nan
    ends = (int(stamp_ns[0]), int(stamp_ns[-1]))
    assert np.max(np.abs(path_of(stamp_ns, wild, ends, 0.0).at(stamp_ns) - s_mm)) < 1.0
