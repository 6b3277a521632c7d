"""Gauge R&R: AIAG's published study, statsmodels, known variances, and photos."""

import json
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

from seamlog.analysis.bead.synthetic import Scene, render
from seamlog.analysis.gauge.anova import gauge_rr
from seamlog.analysis.gauge.study import crossed, read_study
from seamlog.cli import ExitCode, main
from seamlog.errors import EvidenceError, InputError
from seamlog.results import Results

AIAG = np.array(
    [
        [
            [0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
            [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
            [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31],
        ],
        [
            [0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
            [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
            [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50],
        ],
        [
            [0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
            [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
            [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16],
        ],
    ]
).transpose(2, 0, 1)
"""The study of the AIAG manual: parts x operators x trials."""


def test_the_published_study() -> None:
    found = gauge_rr(AIAG)
    assert found.pooled
    assert found.repeatability == pytest.approx(0.199933, abs=2e-6)
    assert found.reproducibility == pytest.approx(0.226838, abs=2e-6)
    assert found.gauge == pytest.approx(0.302373, abs=2e-6)
    assert found.parts == pytest.approx(1.042327, abs=2e-6)
    assert found.percent_grr == pytest.approx(27.86, abs=0.01)
    assert found.categories == 4


def test_the_interaction_is_that_of_statsmodels() -> None:
    part, operator, _ = np.indices(AIAG.shape)
    table = pd.DataFrame({"y": AIAG.ravel(), "p": part.ravel(), "o": operator.ravel()})
    expected = anova_lm(ols("y ~ C(p) * C(o)", table).fit())
    assert gauge_rr(AIAG).interaction_p == pytest.approx(expected.loc["C(p):C(o)", "PR(>F)"])


def test_known_variances_come_back() -> None:
    rng = np.random.default_rng(2)
    shape = (400, 6, 3)
    values = (
        1.0 * rng.standard_normal((shape[0], 1, 1))
        + 0.3 * np.array([-1.2, 0.9, 0.4, -0.6, 1.3, -0.8]).reshape(1, 6, 1)
        + 0.2 * rng.standard_normal((*shape[:2], 1))
        + 0.1 * rng.standard_normal(shape)
    )
    found = gauge_rr(values)
    assert not found.pooled
    assert found.repeatability == pytest.approx(0.1, rel=0.05)
    assert found.repeatability_low < 0.1 < found.repeatability_high
    assert found.interaction == pytest.approx(0.2, rel=0.1)
    assert found.operators == pytest.approx(0.3, rel=0.2)
    assert found.parts == pytest.approx(1.0, rel=0.1)


def test_one_operator_gives_repeatability_only() -> None:
    found = gauge_rr(AIAG[:, :1])
    assert (found.reproducibility, found.interaction_p) == (0, None)
    assert found.repeatability == pytest.approx(np.sqrt(AIAG[:, 0].var(axis=1, ddof=1).mean()))


@pytest.mark.parametrize("shape", [(1, 3, 3), (10, 3, 1), (10, 0, 3)])
def test_studies_that_tell_nothing(shape: tuple[int, ...]) -> None:
    with pytest.raises(EvidenceError):
        gauge_rr(np.zeros(shape))
    with pytest.raises(EvidenceError, match="not complete"):
        gauge_rr(np.where(AIAG > 2, np.nan, AIAG))


def test_a_study_from_a_table(tmp_path: Path) -> None:
    path = tmp_path / "study.csv"
    part, operator, _ = np.indices(AIAG.shape)
    names = {"part": part.ravel(), "operator": operator.ravel(), "width_mm": AIAG.ravel()}
    pd.DataFrame(names).sample(frac=1, random_state=0).to_csv(path, index=False)
    trials = read_study(path)
    study = crossed(trials, [trial.value or 0.0 for trial in trials], "mm")
    assert gauge_rr(study.values).gauge == pytest.approx(0.302373, abs=2e-6)
    with pytest.raises(EvidenceError, match="not crossed"):
        crossed(trials[1:], [trial.value or 0.0 for trial in trials[1:]], "mm")


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "part,width_mm\n1,x\n", "part,photo\n1,\n"])
def test_tables_that_are_no_study(tmp_path: Path, text: str) -> None:
    path = tmp_path / "study.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"study\.csv"):
        read_study(path)


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["bead", *arguments])
    printed = capsys.readouterr()
    return int(ended.value.code or 0), printed.out, printed.err


def test_repeat_photos_of_one_bead(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Three photos of one bead, each with its own noise and a little aside."""
    bead = render(Scene(width_px=800, height_px=300, scallop_mm=0.08), 3)
    rng = np.random.default_rng(0)
    names = []
    for trial, aside in enumerate((0, 24, 8)):
        noisy = bead.pixels[:, aside : aside + 760] + rng.normal(0, 4, (300, 760))
        names.append(str(tmp_path / f"photo{trial}.png"))
        cv2.imwrite(names[-1], np.clip(noisy, 0, 255).astype(np.uint8))
        matrix = bead.calibration.model_copy(update={"image_width_px": 760})
        text = matrix.model_dump_json(by_alias=True)
        (tmp_path / f"photo{trial}.calibration.json").write_text(text)
    output = tmp_path / "gauge.results"
    code, out, err = run(["grr", *names, "-o", str(output), "--json"], capsys)
    assert code == ExitCode.PASS, err
    document = json.loads(out)
    assert document["figures"]["percent_grr"] <= 8
    assert document["figures"]["ndc"] >= 5
    (part,) = Results.open(output).parts()
    assert part.figure("reproducibility_mm").value is None  # type: ignore[union-attr]
    assert run(["grr", *names, "-o", str(output)], capsys)[0] == ExitCode.USAGE
    assert run(["grr", names[0]], capsys)[0] == ExitCode.USAGE
    assert run(["grr"], capsys)[0] == ExitCode.USAGE


def test_synth_writes_truth_that_measure_finds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "made"
    arguments = ["synth", "--case", "snr 20", "--seed", "5", "--count", "2", "-o", str(folder)]
    small = ["--set", "synth.width_px=512", "--set", "synth.height_px=300"]
    assert run([*arguments, *small], capsys)[0] == ExitCode.PASS
    assert run([*arguments, *small], capsys)[0] == ExitCode.USAGE
    truth = pd.read_csv(folder / "snr_20_5.truth.csv")
    inside = truth[(truth.x_px > 30) & (truth.x_px < 480)]
    code, out, _ = run(["measure", str(folder / "snr_20_5.png"), "--json"], capsys)
    (figures,) = json.loads(out)["photos"]
    assert code == ExitCode.PASS
    assert figures["mean_width_mm"] == pytest.approx(inside.width_mm.mean(), abs=0.03)
    assert run(["synth", "--case", "moon", "-o", str(folder)], capsys)[0] == ExitCode.USAGE
    wrong = ["synth", "-o", str(folder), "--set", "synth.nosie=3"]
    assert run(wrong, capsys)[0] == ExitCode.USAGE
