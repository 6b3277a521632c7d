"""Bad input to a replay: a clear error or a flagged, bounded exclusion."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.estimators.guard import make_guarded_estimator
from seamlog.analysis.replay.figures import UNSTABLE
from seamlog.analysis.replay.inputs import replay_inputs
from seamlog.analysis.replay.shadow import shadow_estimator
from seamlog.cli import run
from seamlog.errors import EvidenceError, PluginFailed
from seamlog.mcap.batch import BatchWriter
from seamlog.results import Results

from .test_replay import MakeLoop

OWN = """
class Law:
    state_names = ()

    def __init__(self, config, axis, period_s):
        self.count = 0

    def output(self, reference_m, reference_m_s, reference_m_s2, position_m, velocity_m_s):
        self.count += 1
        {fault}
        return 20.0 * (reference_m - position_m) + 8.0 * (reference_m_s - velocity_m_s)

    def state(self):
        return ()
"""
FEW = ["--set", "replay.members=2"]


def test_repeated_stamps_are_left_out_and_told(loop: MakeLoop) -> None:
    record = loop()
    stamp_ns = record.stamp_ns.copy()
    stamp_ns[100] = stamp_ns[99]
    inputs = replay_inputs(replace(record, stamp_ns=stamp_ns))
    assert any("1 rows whose stamp repeats" in note for note in inputs.notes)
    assert inputs.filled.sum() == 1


def test_nan_is_filled_flagged_and_never_judged(loop: MakeLoop) -> None:
    record = loop()
    position_m = record.position_m.copy()
    position_m[200:205] = np.nan
    inputs = replay_inputs(replace(record, position_m=position_m))
    assert inputs.filled.nonzero()[0].tolist() == [200, 201, 202, 203, 204]
    assert np.isfinite(inputs.record.position_m).all()


def test_a_long_hole_is_refused_with_its_time(loop: MakeLoop) -> None:
    record = loop(seed=1)
    long = record.rows(np.concatenate([np.arange(300), np.arange(360, len(record))]))
    with pytest.raises(EvidenceError, match=r"missing|hole of 2\.4 s"):
        replay_inputs(long)


def test_a_session_without_commands_is_refused(
    loop: MakeLoop, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, path = loop(), tmp_path / "mute.mcap"
    with BatchWriter(path) as writer:
        columns = {"stamp_ns": record.stamp_ns, "position_m": record.position_m}
        writer.write("/table/encoder", columns | {"velocity_m_s": record.velocity_m_s})
    words = ["replay", str(path), "--controller", "pd", "-o", str(tmp_path / "o.mcap")]
    assert run(words) == 3
    assert "/table/command" in capsys.readouterr().err


def test_names_are_checked_before_anything_is_read_and_all_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["replay", str(tmp_path / "absent.mcap"), "--controller", "pdd", "--estimator", "rlss"]
    faults = ["--controller", "pd", "--set", "replay.controllers.pd.kp=-1"]
    assert run([*words, *faults, "-o", str(tmp_path / "o.mcap")]) == 2
    told = capsys.readouterr().err
    for word in ("'pdd'", "'rlss'", "replay.controllers.pd.kp"):
        assert word in told


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("if self.count > 7: raise ValueError('lost')", "ValueError: lost"),
        ("if self.count > 7: return float('nan')", "nan"),
    ],
)
def test_own_code_that_fails_ends_the_replay_and_writes_nothing(
    loop: MakeLoop,
    session_of: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    fault: str,
    message: str,
) -> None:
    law, out = tmp_path / "law.py", tmp_path / "o.mcap"
    law.write_text(OWN.format(fault=fault))
    words = ["replay", str(session_of(loop())), "--controller", f"{law}:Law", *FEW]
    assert run([*words, "-o", str(out)]) != 0
    told = capsys.readouterr().err
    assert "'Law'" in told
    assert message in told
    assert not out.exists()


def test_a_loop_that_runs_away_has_no_figure(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    law, results = tmp_path / "law.py", tmp_path / "r"
    law.write_text(OWN.format(fault="return -500.0 * (reference_m - position_m)"))
    words = ["replay", str(session_of(loop())), "--controller", f"{law}:Law", *FEW]
    code = run([*words, "-o", str(tmp_path / "o.mcap"), "--results", str(results)])
    assert code == 0
    figure = Results.open(results).parts()[0].figure("Law_rms_error_mm")
    assert figure is not None
    assert figure.value is None
    assert figure.reason == UNSTABLE


class Broken:
    """An estimator of somebody else."""

    def __init__(self, config: object, period_s: float) -> None:
        self.count = 0

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        self.count += 1
        if self.count > 5:
            raise ZeroDivisionError("no inertia")
        return float("nan")

    def parameters(self) -> tuple[float, float]:
        return 1.0, 2.0

    def variances(self) -> tuple[float, float, float]:
        return 1.0, 2.0, 3.0


def test_an_estimator_that_fails_is_named_with_its_sample(loop: MakeLoop) -> None:
    with pytest.raises(PluginFailed, match=r"'odd' failed at sample 5: ZeroDivisionError"):
        guarded = make_guarded_estimator(Broken, None, 0.04, "odd")
        for _ in range(6):
            guarded.update(0.0, 0.0, 0.0)
    with pytest.raises(PluginFailed, match="ValueError"):
        shadow_estimator(make_guarded_estimator(Broken, None, 0.04, "odd"), loop(), 1)
