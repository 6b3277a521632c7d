"""Results: written whole, read back equal, never followed out of their folder."""

from pathlib import Path

import numpy as np
import pytest

from seamlog.errors import ResultsError
from seamlog.results import Figure, Part, Picture, Results, Verdict, worst


def test_part_with_table_and_picture_round_trips(tmp_path: Path) -> None:
    results = Results.create(tmp_path / "weld.results")
    columns = {"stamp_ns": np.array([1, 2]), "error_mm": np.array([0.5, np.nan])}
    picture = Picture(file="x.png", caption="bead", width_px=4, height_px=3, sha256="")
    figure = Figure(name="rms_mm", label="rms error", value=None, unit="mm", reason="no encoder")
    part = results.write(
        Part(part="tracking", title="Tracking", figures=[figure]),
        {"error": (columns, {"error_mm": "mm"})},
        {"photo": (b"data", picture)},
    )
    again = Results.open(results.folder)
    assert again.parts() == [part]
    assert part.tables["error"].columns == {"stamp_ns": "", "error_mm": "mm"}
    np.testing.assert_array_equal(again.columns(part, "error")["error_mm"], columns["error_mm"])
    assert again.picture(part, "photo") == b"data"
    found = part.figure("rms_mm")
    assert found is not None and found.reason == "no encoder"


def test_several_parts_of_one_kind(tmp_path: Path) -> None:
    results = Results.create(tmp_path)
    for index in (1, 2):
        results.write(Part(part="bead", index=index, title="Bead"))
    assert [part.index for part in results.parts()] == [1, 2]


@pytest.mark.parametrize("content", [None, "", "{}", '{"schema": "other"}'])
def test_what_is_no_results_folder_is_refused(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "x.json").write_text(content)
    with pytest.raises(ResultsError):
        Results.open(tmp_path).parts()


def test_a_table_outside_the_folder_is_not_followed(tmp_path: Path) -> None:
    results = Results.create(tmp_path)
    part = results.write(Part(part="x", title="X"), {"t": ({"a": np.arange(2)}, {})})
    stolen = part.tables["t"].model_copy(update={"file": "../secret.parquet"})
    with pytest.raises(ResultsError, match="plain file name"):
        results.columns(part.model_copy(update={"tables": {"t": stolen}}), "t")


def test_what_was_not_assessed_never_counts_as_passed() -> None:
    assert worst([]) is Verdict.NOT_ASSESSED
    assert worst([Verdict.PASS]) is Verdict.PASS
    assert worst([Verdict.PASS, Verdict.NOT_MEASURABLE]) is Verdict.NOT_MEASURABLE
    assert worst([Verdict.NOT_ASSESSED, Verdict.FAIL, Verdict.PASS]) is Verdict.FAIL
