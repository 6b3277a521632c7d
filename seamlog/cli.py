"""The command line: finds commands by name, prints outcomes, turns errors into exit codes."""

import importlib
import json
import os
import sys
from enum import IntEnum
from typing import Any, NoReturn

import click

from seamlog.called import calling
from seamlog.command import Group
from seamlog.errors import (
    EvidenceError,
    HardwareError,
    SeamlogError,
    UsageError,
)
from seamlog.outcome import Ending, Outcome

COMMANDS: dict[str, tuple[str, str]] = {
    "record": ("seamlog.recorder.commands.record:record", "Record a live source into a session."),
    "sources": (
        "seamlog.recorder.commands.sources:sources",
        "List and probe what can be recorded.",
    ),
    "import": ("seamlog.recorder.importers.command:import_", "Turn a foreign log into a session."),
    "info": ("seamlog.commands.info:info", "Say what is in a session."),
    "doctor": ("seamlog.commands.doctor:doctor", "Say whether a session is whole."),
    "recover": (
        "seamlog.recorder.commands.recover:recover",
        "Save what is left of a damaged or unfinished one.",
    ),
    "attach": ("seamlog.commands.attach:attach", "Put photos, procedures, calibrations in."),
    "compact": ("seamlog.commands.compact:compact", "Rewrite a session into large chunks."),
    "export": ("seamlog.commands.export:export", "Session to Parquet, CSV, MAT, video, Rerun."),
    "identify": ("seamlog.analysis.commands.identify:identify", "Find inertia and friction."),
    "replay": ("seamlog.analysis.commands.replay:replay", "Run logged inputs through code again."),
    "sweep": ("seamlog.analysis.commands.sweep:sweep", "Rank many tunings of controllers."),
    "bead": ("seamlog.analysis.commands.bead:bead", "Measure the bead on photos."),
    "calibrate": ("seamlog.analysis.commands.calibrate:calibrate", "Pixels to millimetres."),
    "analyze": ("seamlog.analysis.commands.analyze:analyze", "Session and photos to results."),
    "report": ("seamlog.reports.commands:report", "Results to one HTML file."),
    "compare": ("seamlog.reports.compare_command:compare", "Results beside each other."),
    "verify": ("seamlog.commands.verify:verify", "Recompute a report's figures from its inputs."),
    "demo": ("seamlog.commands.demo:demo", "A virtual weld through the whole chain."),
    "plugins": ("seamlog.commands.plugins:plugins", "List what is pluggable."),
    "env": ("seamlog.commands.env:env", "Versions, for a bug report."),
}
"""Our own commands: name to (target, help). A test compares it with the entry points."""


class ExitCode(IntEnum):
    """How a command ended, for scripts."""

    PASS = 0
    FINDING = 1
    """It ran, but there is a finding, a FAIL, a regression or a loss."""
    USAGE = 2
    """Usage or configuration."""
    INPUT = 3
    """An input is unreadable."""
    HARDWARE = 4
    """Hardware, a driver or an extra is missing."""
    BATCH = 5
    """A part of a batch failed."""
    EVIDENCE = 6
    """Not enough evidence for the verdict asked for."""
    BUG = 70
    ABORTED = 130


_ENDINGS = {
    Ending.PASS: ExitCode.PASS,
    Ending.FINDING: ExitCode.FINDING,
    Ending.BATCH_FAILED: ExitCode.BATCH,
    Ending.NO_EVIDENCE: ExitCode.EVIDENCE,
}


class _Commands(Group):
    """The top group: names come from the table, code is imported when a command is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        if cmd_name in COMMANDS:
            module, _, attribute = COMMANDS[cmd_name][0].partition(":")
            found = getattr(importlib.import_module(module), attribute)
        else:
            from seamlog import plugins

            found = plugins.load("seamlog.commands", cmd_name)
        assert isinstance(found, click.Command)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


def _print_version(context: click.Context, _: click.Parameter, value: bool) -> None:
    if value:
        from seamlog import __version__

        click.echo(f"seamlog {__version__}")
        context.exit()


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Print the version.",
)
def seamlog() -> None:
    """Flight recorder and replay laboratory of robotic seam tracking."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Entry point of the `seamlog` command."""
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """Run one command line and return its exit code; nothing escapes but the code."""
    as_json = "--json" in arguments
    try:
        outcome = invoke(arguments)
    except click.exceptions.Exit as exit_:
        return exit_.exit_code
    except BaseException as error:  # noqa: BLE001 - the one place that turns all into codes
        code, message = _explain(error)
        _complain(code, message, as_json)
        return code
    if isinstance(outcome, Outcome):
        return _tell(outcome, as_json)
    return ExitCode.PASS


def invoke(arguments: list[str]) -> object:
    """Run one command line and hand its `Outcome` back; errors pass through.

    For commands that chain others (`demo`): they reach them by name, as a person would.
    """
    with calling(arguments), seamlog.make_context("seamlog", arguments or ["--help"]) as context:
        return seamlog.invoke(context)


def _explain(error: BaseException) -> tuple[ExitCode, str]:
    if isinstance(error, click.UsageError):
        hint = f" (see '{error.ctx.command_path} --help')" if error.ctx else ""
        return ExitCode.USAGE, error.format_message() + hint
    if isinstance(error, click.ClickException):
        return ExitCode.USAGE, error.format_message()
    if isinstance(error, KeyboardInterrupt | click.Abort):
        return ExitCode.ABORTED, "aborted"
    if isinstance(error, UsageError):
        return ExitCode.USAGE, str(error)
    if isinstance(error, HardwareError):
        return ExitCode.HARDWARE, str(error)
    if isinstance(error, EvidenceError):
        return ExitCode.EVIDENCE, str(error)
    if isinstance(error, SeamlogError):
        return ExitCode.INPUT, str(error)
    if isinstance(error, OSError):
        return ExitCode.INPUT, _os_message(error)
    return ExitCode.BUG, _bug(error)


def _os_message(error: OSError) -> str:
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}"


def _bug(error: BaseException) -> str:
    if os.environ.get("SEAMLOG_DEBUG"):
        raise error
    return (
        f"this is a bug in seamlog: {type(error).__name__}: {error}; run again with "
        "SEAMLOG_DEBUG=1 and report the traceback with the output of 'seamlog env'"
    )


def _complain(code: ExitCode, message: str, as_json: bool) -> None:
    click.echo(f"seamlog: {message}", err=True)
    if as_json:
        document = {"schema": "seamlog.error", "version": 1, "exit_code": int(code)}
        click.echo(json.dumps(document | {"message": message}))


def _tell(outcome: Outcome, as_json: bool) -> int:
    code = _ENDINGS[outcome.ending]
    if as_json:
        head = {
            "schema": outcome.schema,
            "version": outcome.version,
            "ending": outcome.ending.value,
        }
        click.echo(json.dumps(head | outcome.document, allow_nan=False, default=_plain))
    else:
        click.echo(outcome.text.rstrip("\n"))
    return code


def _plain(value: Any) -> Any:
    if hasattr(value, "item"):
        return value.item()
    return str(value)


if __name__ == "__main__":
    main()
