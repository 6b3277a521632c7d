"""The check of the original: what was recorded comes again, or it is said where it does not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seamlog.cli import run
from seamlog.results import Results, Verdict

from .test_replay import MakeLoop, controller_metadata


def test_the_original_is_reproduced(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    path = session_of(loop(), metadata=controller_metadata())
    results = tmp_path / "r"
    assert run(["replay", str(path), "--check-original", "--results", str(results)]) == 0
    part = Results.open(results).parts()[0]
    assert part.verdict is Verdict.PASS
    assert [criterion.name for criterion in part.criteria] == ["original /table/command.command"]


def test_a_changed_command_is_found_and_itemised(
    loop: MakeLoop, session_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    record = loop()
    command = record.command.copy()
    command[300:303] += 1e-3
    path = session_of(replace(record, command=command), metadata=controller_metadata())
    assert run(["replay", str(path), "--check-original"]) == 1
    told = capsys.readouterr().out
    assert "/table/command.command is not reproduced: 3 of 750 values differ" in told
    assert str(record.log_time_ns[300]) in told
    tolerant = ["--set", "replay.check.absolute=2e-3"]
    assert run(["replay", str(path), "--check-original", *tolerant]) == 0


def test_a_command_logged_a_period_late_needs_the_time_tolerance(
    loop: MakeLoop, session_of: Callable[..., Path]
) -> None:
    record = loop()
    late = np.concatenate([record.command[:1], record.command[:-1]])
    path = session_of(replace(record, command=late), metadata=controller_metadata())
    assert run(["replay", str(path), "--check-original"]) == 1
    tolerant = ["--set", "replay.check.time_s=0.04"]
    assert run(["replay", str(path), "--check-original", *tolerant]) == 0


def test_the_check_leaves_out_holes_and_says_so(
    loop: MakeLoop, session_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    record = loop()
    kept = np.ones(len(record), dtype=np.bool_)
    kept[[50, 51, 400]] = False
    path = session_of(record.rows(kept), metadata=controller_metadata())
    assert run(["replay", str(path), "--check-original"]) == 0
    told = capsys.readouterr().out
    assert "103 control periods were left out of the check" in told


@pytest.mark.parametrize(
    ("command", "saturated", "message"),
    [(0.0, False, "no controller was engaged"), (20.0, True, "no controller was engaged")],
)
def test_a_controller_that_never_worked_fails_the_check(
    loop: MakeLoop,
    session_of: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
    command: float,
    saturated: bool,
    message: str,
) -> None:
    record = loop()
    idle = replace(
        record,
        command=np.full(len(record), command),
        saturated=np.full(len(record), saturated),
    )
    path = session_of(idle, metadata=controller_metadata())
    assert run(["replay", str(path), "--check-original"]) == 1
    assert message in capsys.readouterr().out


def test_saturation_throughout_shows_no_controller(
    loop: MakeLoop, session_of: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    record = loop()
    full = replace(
        record, command=20.0 * np.sign(record.command), saturated=np.ones(len(record), np.bool_)
    )
    path = session_of(full, metadata=controller_metadata())
    assert run(["replay", str(path), "--check-original"]) == 1
    assert "at its limit" in capsys.readouterr().out


def test_the_check_without_a_known_controller_gives_no_verdict(
    loop: MakeLoop, session_of: Callable[..., Path]
) -> None:
    assert run(["replay", str(session_of(loop())), "--check-original"]) == 6
