"""`seamlog bead measure` as people and programs call it."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.writer import Writer

from seamlog.analysis.bead.sources import frame_before
from seamlog.analysis.bead.synthetic import Scene, render
from seamlog.analysis.surface.synthetic_spatter import spattered
from seamlog.channels import ARC_OFF, ARC_ON
from seamlog.cli import ExitCode, main
from seamlog.clock import SIMULATED_EPOCH_NS, SimulatedClock
from seamlog.recorder import Recorder
from seamlog.results import Results, Verdict
from seamlog.session import open_session


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    printed = capsys.readouterr()
    return int(ended.value.code or 0), printed.out, printed.err


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    bead = render(Scene(width_px=512, height_px=300, noise=3), 1)
    path = tmp_path / "weld.png"
    cv2.imwrite(str(path), bead.pixels)
    calibration = bead.calibration.model_dump_json(by_alias=True)
    (tmp_path / "weld.calibration.json").write_text(calibration)
    return path


def test_json_and_results(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = photo.parent / "r"
    arguments = ["bead", "measure", str(photo), "--start", "left", "-o", str(output), "--json"]
    code, out, _ = run(arguments, capsys)
    document = json.loads(out)
    assert code == ExitCode.PASS
    assert document["schema"] == "seamlog.bead.measure"
    figures = document["photos"][0]
    assert figures["mean_width_mm"] == pytest.approx(6, abs=0.3)
    wanted = {"width_std", "width_cv", "range", "peak_to_peak_25mm", "stations", "flagged"}
    assert wanted | {"confidence", "verdict"} <= set(figures)
    part = Results.open(output).parts()[0]
    assert (part.part, part.pictures["overlay"].file) == ("bead", "bead.overlay.webp")
    assert run(arguments, capsys)[0] == ExitCode.USAGE, "nothing is overwritten"
    assert run([*arguments, "--force"], capsys)[0] == ExitCode.PASS


def test_limits_from_the_configuration(photo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["bead", "measure", str(photo), "--set"]
    assert run([*arguments, "bead.max_width_mm=8"], capsys)[0] == ExitCode.PASS
    code, out, _ = run([*arguments, "bead.max_width_mm=5"], capsys)
    assert (code, "FAIL" in out) == (ExitCode.FINDING, True)
    assert run([*arguments, "bead.max_widht_mm=5"], capsys)[0] == ExitCode.USAGE


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (cv2.imencode(".png", np.full((200, 300), 90, np.uint8))[1].tobytes(), ExitCode.EVIDENCE),
        (b"no picture", ExitCode.INPUT),
        (b"", ExitCode.INPUT),
    ],
)
def test_one_message_and_the_right_code(
    tmp_path: Path, content: bytes, code: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.png"
    path.write_bytes(content)
    ended, out, err = run(["bead", "measure", str(path), "-o", str(tmp_path / "r")], capsys)
    assert ended == code
    assert "x.png" in err
    assert not out
    assert (tmp_path / "r").exists() == (code is ExitCode.EVIDENCE)


def test_a_refused_photo_has_its_place_in_the_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, folder = tmp_path / "x.png", tmp_path / "r"
    assert cv2.imwrite(str(path), np.full((200, 300), 90, np.uint8))
    assert run(["bead", "measure", str(path), "-o", str(folder)], capsys)[0] == ExitCode.EVIDENCE
    (part,) = Results.open(folder).parts()
    assert (part.verdict, part.figures[0].value) == (Verdict.NOT_MEASURABLE, None)
    assert "x.png" in part.reason


def test_nothing_to_measure_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(["bead", "measure"], capsys)
    assert code == ExitCode.USAGE
    assert "name a photo" in err


def test_quality_and_surface_through_the_command(
    photo: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = photo.parent / "limits.toml"
    config.write_text(
        '[quality]\nlevel = "C"\nplate_thickness_mm = 8\n[quality.limits]\n'
        "width_mm = { lower = 4, upper = 8 }\ngaps = { upper = 0 }\n"
    )
    output = photo.parent / "r"
    arguments = ["bead", "measure", str(photo), "--config", str(config), "-o", str(output)]
    code, out, _ = run([*arguments, "--json"], capsys)
    (document,) = json.loads(out)["photos"]
    verdicts = {limit["name"]: limit["verdict"] for limit in document["limits"]}
    assert (verdicts["width_mm"], verdicts["gaps"]) == ("PASS", "PASS")
    assert code == ExitCode.EVIDENCE, "rows that were asked for could not be judged"
    assert verdicts["iso_100"] == "NOT MEASURABLE"
    assert document["surface"]["spatter_count"] <= 2
    assert {part.part for part in Results.open(output).parts()} == {"bead", "surface", "quality"}
    assert (output / "bead.stations.csv").read_text().startswith("s_mm,width_mm,u_width_mm")
    config.write_text("[quality.limits]\nwidht_mm = { upper = 8 }\n")
    code, _, err = run([*arguments, "--force"], capsys)
    assert (code, "widht_mm" in err) == (ExitCode.USAGE, True)
    missing = [*arguments, "--force", "--before", str(photo.parent / "nowhere.png")]
    assert run(missing, capsys)[0] in (ExitCode.USAGE, ExitCode.INPUT)


def test_photos_of_different_beads_are_not_stitched(
    photo: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bead = render(Scene(width_px=512, height_px=300, noise=3), 9)
    other = photo.with_name("other.png")
    assert cv2.imwrite(str(other), bead.pixels)
    text = bead.calibration.model_dump_json(by_alias=True)
    other.with_suffix(".calibration.json").write_text(text)
    code, out, _ = run(["bead", "measure", str(photo), str(other), "--json"], capsys)
    document = json.loads(out)
    assert (code, len(document["photos"])) == (ExitCode.PASS, 2)
    assert "photos 1 and 2" in document["not_stitched"]


def recorded_with(frame: np.ndarray, path: Path) -> Path:
    """A session of one weld with one camera picture from before its arc."""
    first = SIMULATED_EPOCH_NS
    clock = SimulatedClock(first)
    with Recorder(path, clock=clock, pace="simulated", force=True) as recorder:
        recorder.log_frame("/camera/image", frame, first)
        for seconds, kind in ((1, ARC_ON), (10, ARC_OFF)):
            clock.advance_to(first + seconds * 10**9)
            recorder.log("/events", first + seconds * 10**9, kind=kind, detail="")
    return path


def test_marks_on_a_picture_of_the_log_from_before_the_arc_do_not_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = spattered(Scene(width_px=800, noise=2, texture=6), 40, 7)
    photo = tmp_path / "plate.png"
    assert cv2.imwrite(str(photo), case.photo.pixels)
    session = recorded_with(np.roll(case.photo.pixels, (6, -9), axis=(0, 1)), tmp_path / "w.mcap")
    command = ["bead", "measure", str(photo), "--json"]
    counts = {}
    for name, more in {
        "photo alone": [],
        "plate in the log": ["--session", str(session)],
        "something else in the log": [
            "--session",
            str(recorded_with(np.zeros((200, 300), np.uint8), tmp_path / "other.mcap")),
        ],
    }.items():
        code, out, _ = run([*command, *more], capsys)
        assert code == ExitCode.PASS
        counts[name] = json.loads(out)["photos"][0]["surface"]["spatter_count"]
    assert counts["photo alone"] == pytest.approx(len(case.drops), abs=4)
    assert counts["plate in the log"] <= 2
    assert counts["something else in the log"] == counts["photo alone"]


def test_frames_that_cannot_be_read_are_no_picture_from_before(tmp_path: Path) -> None:
    with open_session(recorded_with(np.full((60, 80), 90, np.uint8), tmp_path / "w.mcap")) as whole:
        found = frame_before(whole, SIMULATED_EPOCH_NS + 10**9)
        assert found is not None
        assert found.photo.pixels.shape == (60, 80)
        assert frame_before(whole, SIMULATED_EPOCH_NS) is None
    foreign = tmp_path / "foreign.mcap"
    with foreign.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"uint8[] data")
        channel = writer.register_channel("/camera/image", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0" + bytes(8), 1)
        writer.finish()  # type: ignore[no-untyped-call]
    with open_session(foreign) as session:
        assert frame_before(session, 2) is None
