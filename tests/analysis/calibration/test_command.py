"""`seamlog calibrate` as people and programs call it."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog.analysis.calibration.board import Board
from seamlog.analysis.calibration.synthetic import View, render_board
from seamlog.calibration import load_calibration, parse_any_calibration
from seamlog.cli import ExitCode, main
from tests.analysis.calibration.test_boards import LENS

BOARD = Board(14, 10, 8.0)
GIVEN = ["--squares", "14x10", "--square-mm", "8"]


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["calibrate", *arguments])
    printed = capsys.readouterr()
    return int(ended.value.code or 0), printed.out, printed.err


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("boards")
    tilts = [(3.0, 2.0), (28.0, 4.0), (-24.0, -20.0), (2.0, 30.0)]
    paths = []
    for number, tilt in enumerate(tilts):
        picture, _ = render_board(BOARD, View(LENS, 960, 720, 190.0, tilt), number)
        paths.append(folder / f"board{number}.png")
        assert cv2.imwrite(str(paths[-1]), picture)
    return paths


def test_lens_then_plane_then_table(
    photos: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lens, plane, tied = (tmp_path / name for name in ("lens.json", "plane.json", "table.json"))
    names = [str(path) for path in photos]
    assert run(["camera", *names, *GIVEN, "-o", str(lens)], capsys)[0] == ExitCode.PASS
    assert parse_any_calibration(lens.read_bytes(), "lens").kind == "lens"
    arguments = ["plane", names[0], *GIVEN, "--lens", str(lens), "-o", str(plane), "--json"]
    code, out, _ = run(arguments, capsys)
    document = json.loads(out)
    assert (code, document["schema"]) == (ExitCode.PASS, "seamlog.calibrate.plane")
    assert document["calibration"]["kind"] == "plane"
    assert run(arguments, capsys)[0] == ExitCode.USAGE, "nothing is overwritten"
    places = load_calibration(plane).plane_mm(np.array([[100.0, 100.0], [800.0, 600.0]]))  # type: ignore[union-attr]
    points = [
        ["--point", str(x), str(y), str(mm[0] + 7), str(mm[1] - 5)]
        for (x, y), mm in zip(((100, 100), (800, 600)), places, strict=True)
    ]
    told = [word for point in points for word in point]
    arguments = ["table", names[0], "--calibration", str(plane), *told, "-o", str(tied)]
    assert run(arguments, capsys)[0] == ExitCode.PASS
    assert load_calibration(tied).frame == "table"  # type: ignore[union-attr]


def test_a_scale_lies_beside_its_photo(
    photos: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["scale", str(photos[0]), "--length", "50", "100", "300", "600", "300"]
    code, out, _ = run([*arguments, "--force"], capsys)
    assert code == ExitCode.PASS
    assert "4 %" in out
    assert load_calibration(photos[0].with_suffix(".calibration.json")).kind == "scale"


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (["plane", "PHOTO", "--squares", "14", "--square-mm", "8"], ExitCode.USAGE, "10x7"),
        (["plane", "PHOTO", "--squares", "7x5", "--square-mm", "-1"], ExitCode.USAGE, "mm"),
        (["plane", "PHOTO", "--board", "charuco", *GIVEN], ExitCode.USAGE, "--marker-mm"),
        (["plane", "PHOTO", "--squares", "21x18", "--square-mm", "8"], ExitCode.EVIDENCE, "board"),
        (["plane", "nowhere.png", *GIVEN], ExitCode.INPUT, "nowhere.png"),
        (["plane", "PHOTO", *GIVEN, "--lens", "PHOTO"], ExitCode.INPUT, "no"),
        (["scale", "PHOTO"], ExitCode.USAGE, "--ruler"),
        (["camera", "PHOTO", *GIVEN, "-o", "OUT"], ExitCode.EVIDENCE, "3 are needed"),
    ],
)
def test_one_message_and_the_right_code(
    arguments: list[str],
    code: ExitCode,
    word: str,
    photos: list[Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out.json"
    given = {"PHOTO": str(photos[1]), "OUT": str(out)}
    ended, _, err = run([given.get(item, item) for item in arguments], capsys)
    assert (ended, word in err) == (code, True), err
    assert not out.exists()
    assert not photos[1].with_suffix(".calibration.json").exists()
