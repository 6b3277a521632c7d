"""Sweeps: every fault at once, the right winner, an honest doubt, and going on where it stopped."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.sweep.plan import make_points
from seamlog.analysis.sweep.settings import SweepSettings
from seamlog.cli import run
from seamlog.errors import ConfigError
from seamlog.results import Results

MakeLoop = Callable[..., AxisRecord]
FEW = ["--set", "sweep.members=6"]


def test_a_grid_makes_every_combination() -> None:
    settings = SweepSettings(grid={"pd:kp": [1, 2, 3], "pd:kd": [4, 5]})
    points = make_points(["pd", "paper"], settings)
    assert [point.choice.name for point in points] == ["pd"] * 6 + ["paper"]
    assert {(p.varied["kp"], p.varied["kd"]) for p in points[:6]} == {
        (kp, kd) for kp in (1, 2, 3) for kd in (4, 5)
    }


def test_sobol_points_fill_the_ranges_and_come_again() -> None:
    settings = SweepSettings(ranges={"kp": (10.0, 20.0), "kd": (1.0, 2.0)}, sobol=10)
    one, other = (make_points(["pd"], settings) for _ in range(2))
    assert [point.key for point in one] == [point.key for point in other]
    kp = np.array([point.varied["kp"] for point in one])
    assert len(kp) == 10
    assert kp.min() < 12.5
    assert kp.max() > 17.5
    assert ((kp >= 10) & (kp <= 20)).all()


def test_inner_parameters_are_reached_with_dots() -> None:
    settings = SweepSettings(grid={"law.surface_slope": [2.0, 3.0]})
    points = make_points(["adaptive"], settings)
    assert [point.choice.config["law"]["surface_slope"] for point in points] == [2.0, 3.0]


def test_all_faults_come_at_once() -> None:
    settings = SweepSettings(grid={"kp": [-1.0, -2.0], "kq": [1.0]})
    with pytest.raises(ConfigError) as caught:
        make_points(["pd"], settings)
    told = str(caught.value)
    assert "pd.kp" in told
    assert "pd.kq" in told


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--controller", "pdd", "--grid", "kp=1,2"], "Did you mean 'pd'?"),
        (["--controller", "pd"], "nothing is varied"),
        (["--controller", "pd", "--grid", "kp"], "name=value"),
        (["--controller", "pd", "--range", "kp=1"], "name=low:high"),
        (["--controller", "pd", "--range", "kp=1:2"], "--sobol"),
        (["--controller", "pd", "--range", "kp=2:1", "--sobol", "4"], "not below"),
        (["--controller", "pd", "--grid", "lqr:q=1,2"], "no controller of this sweep"),
        (["--controller", "pd", "--grid", "kp=1,2", "--sobol", "-1"], "sweep.sobol"),
    ],
)
def test_bad_requests_are_told_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    absent = tmp_path / "absent.mcap"
    assert run(["sweep", str(absent), *words, "-o", str(tmp_path / "s")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "s").exists()


def test_a_clear_winner_is_one_and_twins_are_not(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    paths = [str(session_of(loop(seed=seed), f"loop{seed}.mcap")) for seed in (1, 2)]
    clear, twins = tmp_path / "clear", tmp_path / "twins"
    words = ["sweep", *paths, "--controller", "pd", *FEW]
    assert run([*words, "--grid", "kp=5,40", "-o", str(clear)]) == 0
    part = Results.open(clear).parts()[0]
    ranking = Results.open(clear).columns(part, "ranking")
    assert ranking["kp"].tolist() == [40.0, 5.0]
    assert ranking["told_apart"].tolist()[1]
    assert any("better than every other" in finding.message for finding in part.findings)
    np.testing.assert_allclose(
        ranking["value_mm"], 0.5 * (ranking["loop1_mm"] + ranking["loop2_mm"]), rtol=0.02
    )
    assert run([*words, "--grid", "kp=39.9999,40", "-o", str(twins)]) == 0
    part = Results.open(twins).parts()[0]
    assert any("not distinguishable" in finding.message for finding in part.findings)


def test_a_sweep_goes_on_where_it_stopped(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    out = tmp_path / "s"
    words = ["sweep", str(session_of(loop())), "--controller", "pd", "-o", str(out), *FEW]
    assert run([*words, "--grid", "kp=10,20"]) == 0
    assert run([*words, "--grid", "kp=10,20"]) == 2
    before = Results.open(out).columns(Results.open(out).parts()[0], "ranking")
    assert run([*words, "--grid", "kp=10,20,30", "--force"]) == 0
    part = Results.open(out).parts()[0]
    assert part.details["resumed"] == 2
    after = Results.open(out).columns(part, "ranking")
    for kp in (10.0, 20.0):
        old, new = (table["value_mm"][table["kp"] == kp] for table in (before, after))
        np.testing.assert_array_equal(old, new)
    assert run([*words, "--grid", "kp=10,20,30", "--force", "--set", "sweep.seed=1"]) == 0
    assert Results.open(out).parts()[0].details["resumed"] == 0


def test_a_tuning_that_runs_away_comes_last(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    free = {"unit": "N m"}
    path = session_of(loop(), drive=free)
    out = tmp_path / "s"
    words = ["sweep", str(path), "--controller", "pd", "--grid", "kd=500,8", *FEW]
    assert run([*words, "-o", str(out)]) == 0
    part = Results.open(out).parts()[0]
    ranking = Results.open(out).columns(part, "ranking")
    assert ranking["kd"].tolist() == [8.0, 500.0]
    assert np.isnan(ranking["value_mm"][1])
    assert any("1 of 2 tunings run away" in finding.message for finding in part.findings)
