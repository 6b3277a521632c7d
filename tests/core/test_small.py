"""Clock, calibration, plug-ins, errors and files: the small pieces of the core."""

from pathlib import Path

import pytest

from seamlog import errors
from seamlog.calibration import PlaneCalibration, ScaleCalibration, parse_calibration
from seamlog.clock import MonotonicClock, SimulatedClock
from seamlog.errors import CalibrationError, OutputExists, SeamlogError, UnknownName
from seamlog.files import replacing, write_bytes
from seamlog.plugins import load

IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_log_time_never_steps_back() -> None:
    clock = MonotonicClock()
    times = [clock.now_ns() for _ in range(1000)]
    assert times == sorted(times)
    assert abs(clock.step_ns()) < 1_000_000_000


def test_simulated_clock_moves_only_forward() -> None:
    clock = SimulatedClock(5)
    clock.advance_to(9)
    assert clock.now_ns() == 9
    with pytest.raises(ValueError, match="back"):
        clock.advance_to(8)


def test_calibrations_round_trip() -> None:
    plane = PlaneCalibration(
        image_width_px=10,
        image_height_px=5,
        plane_mm_from_px=IDENTITY,
        residual_mm=0.01,
        scale_relative_u=0.002,
    )
    scale = ScaleCalibration(
        image_width_px=10, image_height_px=5, mm_per_px=0.1, scale_relative_u=0.04
    )
    for calibration in (plane, scale):
        text = calibration.model_dump_json(by_alias=True)
        assert parse_calibration(text, "here") == calibration


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        '{"kind": "plane"}',
        '{"kind": "scale", "image_width_px": 1, "image_height_px": 1, "mm_per_px": -1,'
        ' "scale_relative_u": 0}',
    ],
)
def test_what_is_no_calibration_is_refused(text: str) -> None:
    with pytest.raises(CalibrationError, match=r"photo\.json"):
        parse_calibration(text, "photo.json")


def test_a_singular_homography_is_refused() -> None:
    with pytest.raises(ValueError, match="inverse"):
        PlaneCalibration(
            image_width_px=10,
            image_height_px=5,
            plane_mm_from_px=(IDENTITY[0], IDENTITY[0], IDENTITY[2]),
            residual_mm=0,
            scale_relative_u=0,
        )


def test_an_unknown_plugin_lists_the_known() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'paper'") as caught:
        load("seamlog.controllers", "papr")
    assert "pd" in str(caught.value)


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "x.bin"

    def fail_half_way() -> None:
        with replacing(path) as partial:
            partial.write_bytes(b"half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail_half_way()
    assert list(tmp_path.iterdir()) == []
    write_bytes(path, b"whole")
    with pytest.raises(OutputExists, match="--force"):
        write_bytes(path, b"other", force=False)
    assert path.read_bytes() == b"whole"


def test_the_error_tree_is_drawn_in_its_docstring() -> None:
    drawn = errors.__doc__ or ""
    tree = [item for item in vars(errors).values() if isinstance(item, type)]
    assert all(issubclass(item, SeamlogError) for item in tree)
    assert all(item.__name__ in drawn for item in tree)
