import json

import numpy as np
import pytest
from pydantic import ValidationError

from seamlog import plugins
from seamlog.analysis.controllers.adaptive import AdaptiveController
from seamlog.analysis.virtual_cell.source import VirtualCell, VirtualCellConfig
from seamlog.analysis.virtual_cell.view import project
from seamlog.calibration import PlaneCalibration, parse_calibration
from seamlog.channels import ARC_OFF, ARC_ON, CHANNELS, CLOCK_STEP
from seamlog.contracts import Axis

from .listed import CellRun, run_cell

CALIBRATION = "calibration/table_from_camera.json"


@pytest.fixture(scope="module")
def weld() -> CellRun:
    return run_cell()


@pytest.fixture(scope="module")
def faulty() -> CellRun:
    faults = ["dropouts", "clock_step", "seam_jump"]
    return run_cell(seed=2, faults=faults)


def camera(run: CellRun) -> PlaneCalibration:
    found = parse_calibration(run.sink.attachments[CALIBRATION], CALIBRATION)
    assert isinstance(found, PlaneCalibration)
    return found


def test_the_same_seed_gives_the_same_messages_and_another_does_not(
    weld: CellRun, faulty: CellRun
) -> None:
    assert run_cell().digest() == weld.digest()
    assert faulty.column("/table/encoder", 1)[0] != weld.column("/table/encoder", 1)[0]


def test_messages_fit_the_channel_table_and_come_in_order_of_arrival(weld: CellRun) -> None:
    times = [message.log_time_ns for message in weld.sink.messages]
    assert times == sorted(times)
    for message in weld.sink.messages:
        assert message.log_time_ns > message.stamp_ns
        fields = CHANNELS[message.topic].field_names
        expected = 1 if message.topic == "/camera/image" else len(fields) - 1
        assert len(message.values) == expected
    loop, pictures = weld.stamps("/table/encoder"), weld.stamps("/camera/image")
    assert np.ptp(np.diff(loop)) == 0 and np.diff(loop)[0] == 40_000_000
    assert np.ptp(np.diff(pictures)) == 0 and np.diff(pictures)[0] == 100_000_000


def test_identification_runs_along_100_sin_t(weld: CellRun) -> None:
    stamps = weld.stamps("/table/reference")
    time_s = (stamps - stamps[0]) * 1e-9
    first = time_s < 10.0
    position_m = weld.column("/table/reference", 0)
    assert np.allclose(position_m[first], 0.1 * np.sin(time_s[first]), atol=1e-9)


def test_live_estimator_finds_the_planted_axis(weld: CellRun) -> None:
    last = weld.of("/estimator/state")[-1].values
    plant = weld.truth["plant"]
    truth = [plant[name] for name in ("inertia", "viscous_friction", "coulomb_friction")]
    assert last[:3] == pytest.approx(truth, rel=0.03)
    assert all(0.0 < variance < 1.0 for variance in last[3:6])


def test_seam_is_tracked_within_a_millimetre(weld: CellRun) -> None:
    assert np.abs(weld.profile("tracking_error_mm")).max() < 1.0
    on_ns, off_ns = (message.stamp_ns for message in weld.of("/events"))
    stamps = weld.stamps("/table/encoder")
    welding = (stamps >= on_ns) & (stamps < off_ns)
    error_m = (weld.column("/table/reference", 0) - weld.column("/table/encoder", 0))[welding]
    seen_mm = np.interp(stamps[welding], weld.profile("time_ns"), weld.profile("tracking_error_mm"))
    assert np.abs(1e3 * error_m - seen_mm).max() < 0.3


def test_speed_dip_is_where_the_truth_says(weld: CellRun) -> None:
    cause = weld.truth["planted_cause"]
    assert cause["channel"] == "weld_speed"
    assert cause["s_mm"] == pytest.approx(120.0, abs=1.0)
    s, speed, width = (weld.profile(name) for name in ("s_mm", "speed_mm_s", "width_mm"))
    inside = (s > cause["s_start_mm"]) & (s < cause["s_end_mm"])
    assert speed[inside].min() < 0.65 * np.median(speed)
    assert speed[~inside].min() > 0.95 * np.median(speed)
    assert inside[np.argmax(width)]
    times = weld.profile("time_ns")
    assert cause["start_ns"] <= times[inside][0] < times[inside][-1] <= cause["end_ns"]


def test_width_follows_the_stated_rule(weld: CellRun) -> None:
    speed, error = weld.profile("speed_mm_s"), weld.profile("tracking_error_mm")
    rule = 6.0 * np.sqrt(6.0 / speed) + 0.6 * np.abs(error)
    averaged = np.convolve(rule, np.ones(5) / 5, mode="valid")
    assert np.allclose(weld.profile("width_mm")[2:-2], averaged, atol=1e-3)


def test_marker_and_calibration_give_the_torch_and_its_place_on_the_plate(weld: CellRun) -> None:
    marker_px = np.column_stack([weld.column("/robot/marker", i) for i in (0, 1)])
    fixed_mm = project(camera(weld).matrix(), marker_px)
    stamps = weld.stamps("/robot/marker")
    times = weld.profile("time_ns")
    welding = (stamps >= times[0]) & (stamps <= times[-1])
    truth_mm = np.interp(stamps[welding], times, weld.profile("y_mm"))
    assert np.abs(fixed_mm[welding, 1] - truth_mm).max() < 0.5
    assert np.ptp(fixed_mm[:, 0]) < 1.0


def test_seam_points_less_the_table_travel_lie_on_the_seam(weld: CellRun) -> None:
    """x = X - q; the torch's path lies the tracking error beside the seam."""
    seam_y = weld.profile("y_mm")
    seam_x = weld.profile("path_x_mm") - weld.profile("tracking_error_mm")
    matrix = camera(weld).matrix()
    stamps = weld.stamps("/table/encoder")
    travel = 1e3 * weld.column("/table/encoder", 0)
    residuals = []
    for message in weld.of("/seam/points")[::10]:
        fixed_mm = project(matrix, np.column_stack(message.values))
        x_mm = fixed_mm[:, 0] - np.interp(message.stamp_ns, stamps, travel)
        inside = (fixed_mm[:, 1] > 1.0) & (fixed_mm[:, 1] < 199.0)
        residuals.append(x_mm[inside] - np.interp(fixed_mm[inside, 1], seam_y, seam_x))
    assert np.median(np.abs(np.concatenate(residuals))) < 0.4
    path_x, path_y = (1e3 * value for value in weld.of("/seam/path")[-1].values)
    inside = (path_y > 1.0) & (path_y < 199.0)
    fitted = path_x[inside] - np.interp(path_y[inside], seam_y, seam_x)
    assert np.abs(fitted).max() < 0.35


def test_arc_lights_the_picture_and_the_process(weld: CellRun) -> None:
    events = weld.of("/events")
    assert [message.values[0] for message in events] == [ARC_ON, ARC_OFF]
    on_ns, off_ns = (message.stamp_ns for message in events)
    current, stamps = weld.column("/weld/process", 0), weld.stamps("/weld/process")
    welding = (stamps >= on_ns) & (stamps < off_ns)
    assert current[welding].min() > 100.0
    assert np.all(current[~welding] == 0.0)
    burnt = {True: [], False: []}  # type: dict[bool, list[float]]
    for message in weld.of("/camera/image")[::4]:
        image = message.values[0]
        assert image.shape == (480, 640, 3) and image.dtype == np.uint8
        burnt[on_ns <= message.stamp_ns < off_ns].append(float(np.mean(image[..., 2] > 250)))
    assert min(burnt[True]) > 5e-4 > 1e-4 > max(burnt[False])


def test_live_controller_can_be_made_again_from_the_session(weld: CellRun) -> None:
    """Recorded motion through a fresh controller gives the recorded commands, bit for bit."""
    record = weld.sink.metadata["seamlog.controller"]
    factory = plugins.load("seamlog.controllers", record["name"])
    assert factory is AdaptiveController
    config = factory.Config.model_validate_json(record["config"])
    fresh = factory(config, Axis(**json.loads(record["axis"])), 0.04)
    references = [message.values for message in weld.of("/table/reference")]
    measured = [message.values for message in weld.of("/table/encoder")]
    commands = [fresh.output(*r, *m) for r, m in zip(references, measured, strict=True)]
    assert commands == weld.column("/table/command", 0).tolist()
    assert json.loads(weld.sink.channel_metadata["/controller/state"]["names"]) == list(
        fresh.state_names
    )


def test_faults_are_in_the_messages(faulty: CellRun) -> None:
    gaps_s = np.diff(faulty.stamps("/table/encoder")) * 1e-9
    assert gaps_s.max() > 0.25
    assert np.diff(faulty.stamps("/table/command")).max() == 40_000_000
    steps = [message for message in faulty.of("/events") if message.values[0] == CLOCK_STEP]
    pictures = faulty.stamps("/camera/image")
    after = np.searchsorted(pictures, steps[0].stamp_ns)
    assert pictures[after] - pictures[after - 1] == pytest.approx(450_000_000)
    times = [message.log_time_ns for message in faulty.sink.messages]
    assert times == sorted(times)
    assert faulty.truth["planted_cause"] is None


def test_loop_follows_the_plate_after_it_has_slipped(faulty: CellRun) -> None:
    error, s = faulty.profile("tracking_error_mm"), faulty.profile("s_mm")
    assert np.abs(error).max() > 1.5
    assert np.abs(error[s > 0.35 * s[-1] + 40.0]).max() < 1.0


def test_the_cell_is_a_source_found_by_name() -> None:
    factory = plugins.load("seamlog.sources", "virtual-cell")
    assert factory is VirtualCell
    assert factory(factory.Config()).pace == "simulated"
    assert factory.Config().faults == ("speed_dip",)
    with pytest.raises(ValidationError):
        VirtualCellConfig.model_validate({"faults": ["meteor"]})
