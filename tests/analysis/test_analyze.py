"""`analyze`: photos beside the log, and bad input that leaves nothing behind."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord
from seamlog.cli import run
from seamlog.results import Results, Verdict

MakeLoop = Callable[..., AxisRecord]
SessionOf = Callable[..., Path]


def test_a_photo_without_a_bead_is_refused_and_the_rest_stands(
    loop: MakeLoop, session_of: SessionOf, tmp_path: Path
) -> None:
    plate = np.random.default_rng(0).normal(120, 3, (400, 600)).clip(0, 255).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "plate.png"), plate)
    path, results = session_of(loop()), tmp_path / "r"
    assert run(["analyze", str(path), str(tmp_path / "plate.png"), "-o", str(results)]) == 0
    parts = {part.part: part for part in Results.open(results).parts()}
    assert parts["bead"].verdict is Verdict.NOT_MEASURABLE
    assert parts["bead"].figures[0].value is None and parts["bead"].reason
    assert parts["identification"].figure("inertia") is not None


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["no_such_photo.jpg"], 3, "no_such_photo.jpg"),
        (["--weld", "2"], 2, "has no weld 2"),
        (["--set", "limits.tracking_eror_mm=1"], 2, "did you mean tracking_error_mm?"),
        (["--set", "limits.tracking_error_mm=-1"], 2, "limits.tracking_error_mm"),
    ],
)
def test_bad_requests_write_nothing(
    loop: MakeLoop,
    session_of: SessionOf,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    code: int,
    message: str,
) -> None:
    path, results = session_of(loop()), tmp_path / "r"
    assert run(["analyze", str(path), *words, "-o", str(results)]) == code
    assert message in capsys.readouterr().err
    assert not results.exists()


def test_old_welds_do_not_stay_in_the_results(
    loop: MakeLoop, session_of: SessionOf, tmp_path: Path
) -> None:
    path, results = session_of(loop()), tmp_path / "r"
    assert run(["analyze", str(path), "-o", str(results)]) == 0
    old = (results / "tracking.json").read_text().replace('"index": 1', '"index": 2')
    (results / "tracking.2.json").write_text(old)
    assert run(["analyze", str(path), "-o", str(results), "--force"]) == 0
    assert [part.index for part in Results.open(results).parts() if part.part == "tracking"] == [1]
