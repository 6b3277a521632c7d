"""The command line: names, exit codes, one-line messages, JSON on stdout."""

import json
from collections.abc import Callable

import click
import pytest

from seamlog import cli
from seamlog.command import command
from seamlog.errors import EvidenceError, HardwareError, SessionError, UsageError
from seamlog.outcome import Ending, Outcome


def with_command(monkeypatch: pytest.MonkeyPatch, act: Callable[[], Outcome]) -> None:
    @command("act")
    def acting() -> Outcome:
        return act()

    def find(_: object, __: click.Context, name: str) -> click.Command | None:
        return acting if name == "act" else None

    monkeypatch.setattr(cli._Commands, "get_command", find)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (UsageError("no"), 2),
        (SessionError("weld.mcap: empty"), 3),
        (FileNotFoundError(2, "No such file", "weld.mcap"), 3),
        (HardwareError("no camera"), 4),
        (EvidenceError("one-way motion"), 6),
        (RuntimeError("oops"), 70),
        (KeyboardInterrupt(), 130),
    ],
)
def test_errors_become_codes_and_one_message(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    code: int,
) -> None:
    def act() -> Outcome:
        raise error

    with_command(monkeypatch, act)
    assert cli.run(["act", "--json"]) == code
    out, err = capsys.readouterr()
    assert err.startswith("seamlog: ") and "Traceback" not in err
    assert json.loads(out)["exit_code"] == code


@pytest.mark.parametrize(
    ("ending", "code"),
    [
        (Ending.PASS, 0),
        (Ending.FINDING, 1),
        (Ending.BATCH_FAILED, 5),
        (Ending.NO_EVIDENCE, 6),
    ],
)
def test_endings_become_codes(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    ending: Ending,
    code: int,
) -> None:
    with_command(monkeypatch, lambda: Outcome("seamlog.x", "words", {"a": 1}, ending))
    assert cli.run(["act"]) == code
    assert capsys.readouterr().out == "words\n"
    assert cli.run(["act", "--json"]) == code
    document = json.loads(capsys.readouterr().out)
    assert (document["schema"], document["version"], document["a"]) == ("seamlog.x", 1, 1)


def test_unknown_command_lists_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["reprot"]) == 2
    err = capsys.readouterr().err
    assert "'report'" in err and "analyze" in err


def test_unknown_option_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["plugins", "--nope"]) == 2
    assert "--nope" in capsys.readouterr().err


def test_no_arguments_print_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run([]) == 0
    assert "record" in capsys.readouterr().out


def test_env_names_the_libraries(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["env", "--json"]) == 0
    assert {"mcap", "numpy"} <= set(json.loads(capsys.readouterr().out)["libraries"])
