"""What every command shares: `--json`, `--config` and `--set`, and commands loaded when called."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click


class Command(click.Command):
    """A command with `--json`; its function returns an `Outcome` that `seamlog.cli` prints."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.append(
            click.Option(
                ["--json"],
                is_flag=True,
                expose_value=False,
                help="Print one JSON document on stdout.",
            )
        )


class Group(click.Group):
    """A command with several acts, such as `bead measure`."""

    command_class = Command


command = functools.partial(click.command, cls=Command)
"""Decorator for a command; the function returns `seamlog.outcome.Outcome`."""

group = functools.partial(click.group, cls=Group)
"""Decorator for a command with several acts."""

session_argument = click.argument("session", type=click.Path(path_type=Path))
force_option = click.option("--force", is_flag=True, help="Replace outputs that are there.")


def output_option(help_text: str, required: bool = True) -> Callable[[Any], Any]:
    """`-o/--output PATH`, passed as `output`."""
    return click.option(
        "-o", "--output", type=click.Path(path_type=Path), required=required, help=help_text
    )


def config_options(function: Any) -> Any:
    """`--config FILE` and `--set section.key=value`, passed as `config` and `settings`.

    The command hands both to `seamlog.config.load_config` with its section and model.
    """
    config = click.option(
        "--config", type=click.Path(path_type=Path), help="Configuration (seamlog.toml)."
    )
    settings = click.option(
        "--set", "settings", multiple=True, metavar="A.B=C", help="Override one setting."
    )
    return config(settings(function))
