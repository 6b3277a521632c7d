"""A user's own controller: found, run, and every way in which it can fail."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seamlog.analysis.closed_loop import simulate
from seamlog.analysis.replay.factories import (
    choose_controller,
    choose_own_controller,
    controller_label,
)
from seamlog.cli import run as cli_run
from seamlog.errors import ConfigError, InputError, PluginFailed, UnknownName, UsageError
from seamlog.session import open_session
from tests.analysis.axis_bench import COULOMB_AXIS, PERIOD_S, sine

LAW = """
class Law:
    state_names = ("error",)
    def __init__(self, config, axis, period_s):
        {made}
        self.count = 0
    def output(self, reference_m, reference_m_s, reference_m_s2, position_m, velocity_m_s):
        self.count += 1
        {said}
        return 9.0 * (reference_m - position_m)
    def state(self):
        return {states}
"""


def write(folder: Path, made: str = "pass", said: str = "pass", states: str = "(1.0,)") -> str:
    path = folder / "law.py"
    path.write_text(LAW.format(made=made, said=said, states=states))
    return f"{path}:Law"


def run(name: str) -> np.ndarray:
    controller = choose_own_controller(name, {}).make(COULOMB_AXIS, PERIOD_S)
    return simulate(controller, COULOMB_AXIS, sine(0.1, 0.6, 200), PERIOD_S).command


def test_the_example_tracks_and_takes_its_setting(project: Path) -> None:
    name = f"{project / 'examples' / 'own_controller.py'}:Springy"
    choice = choose_own_controller(name, {"rate_1_s": 6.0})
    assert choice.name == controller_label(name) == "Springy"
    assert choice.config == {"rate_1_s": 6.0}
    reference = sine(0.1, 0.6, 500)
    loop = simulate(choice.make(COULOMB_AXIS, PERIOD_S), COULOMB_AXIS, reference, PERIOD_S)
    assert np.abs(loop.tracking_error_m(reference)).max() < 0.02
    with pytest.raises(ConfigError, match=r"replay\.controllers\.Springy\.rate_1_s"):
        choose_own_controller(name, {"rate_1_s": "fast"})


def test_each_run_has_a_fresh_controller(tmp_path: Path) -> None:
    name = write(tmp_path, said="if self.count > 200: raise RuntimeError('used before')")
    assert np.array_equal(run(name), run(name))


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    before = run(write(tmp_path))
    assert not np.array_equal(before, run(write(tmp_path, said="return 0.0")))


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ({"made": "raise KeyError('gain')"}, "cannot be made: KeyError: 'gain'"),
        ({"said": "if self.count == 76: return float('nan')"}, r"nan .*sample 75, 3\.000 s"),
        ({"said": "if self.count == 76: return -1e999"}, "-inf"),
        ({"said": "if self.count == 76: 1 / 0"}, r"ZeroDivisionError.*3\.000 s"),
        ({"said": "return None"}, "TypeError"),
        ({"said": "return 'fast'"}, "ValueError"),
        ({"states": "(1.0, 2.0)"}, "2 states and names 1"),
        ({"states": "None"}, "raised TypeError in state"),
    ],
)
def test_faults_of_the_code_are_told_with_name_and_time(
    tmp_path: Path, fault: dict[str, str], told: str
) -> None:
    with pytest.raises(PluginFailed, match=told) as caught:
        run(write(tmp_path, **fault))
    assert "'Law'" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "name", "error", "told"),
    [
        (None, "law.py:Law", InputError, "no such file"),
        ("", "law.py:Law", UsageError, "no class 'Law'"),
        ("Law = 3", "law.py:Law", UsageError, "no class 'Law'"),
        ("class Law: pass", "law.py:Law", UsageError, "lacks output and state"),
        ("class Law:", "law.py:Law", PluginFailed, "cannot be run: IndentationError"),
        ("import no_such_thing", "law.py:Law", PluginFailed, "no_such_thing"),
        ("", "law.py", UsageError, "path.py:Class"),
        ("", "law.py:not a name", UsageError, "path.py:Class"),
        (LAW.replace("class Law", "class pd"), "law.py:pd", UsageError, "rename"),
    ],
)
def test_what_is_no_controller_is_refused(
    tmp_path: Path, text: str | None, name: str, error: type[Exception], told: str
) -> None:
    if text is not None:
        (tmp_path / "law.py").write_text(text)
    with pytest.raises(error, match=told):
        choose_own_controller(str(tmp_path / name), {})


def test_a_recorded_name_never_runs_a_file(tmp_path: Path) -> None:
    with pytest.raises(UnknownName):
        choose_controller(write(tmp_path), {})


def test_the_command_replays_through_a_file_and_tells_its_faults(
    project: Path,
    tmp_path: Path,
    loop: Callable[..., Any],
    session_of: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
) -> None:
    session, out = session_of(loop()), tmp_path / "out.mcap"
    own = f"{project / 'examples' / 'own_controller.py'}:Springy"
    words = ["replay", str(session), "-o", str(out), "--set", "replay.members=2", "--controller"]
    assert cli_run([*words, own]) == 0
    with open_session(out) as opened:
        assert opened.info.channels["/replay/Springy/shadow/command"].count == 750
        assert opened.info.channels["/replay/Springy/counterfactual/encoder"].count == 750
    capsys.readouterr()
    broken = write(tmp_path, said="if self.count == 76: return float('nan')")
    assert cli_run([*words, broken, "--force"]) != 0
    told = capsys.readouterr().err
    assert "'Law'" in told and "3.000 s" in told and "Traceback" not in told
