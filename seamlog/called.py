"""How the running command was called, in a form that can be run again elsewhere.

Results carry it, so that `seamlog verify` can recompute their figures: files by name, the settings
of a configuration file written out, outputs as places to fill in. It holds no path of a machine.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

RESULTS, OUTPUT = "{results}", "{output}"
_OUTPUTS = ("-o", "--output")
_DROPPED = ("--json", "--force")
_called: ContextVar[tuple[str, ...]] = ContextVar("called", default=())


@contextmanager
def calling(arguments: Sequence[str]) -> Iterator[None]:
    """Within this, `call_to` tells of `arguments`."""
    token = _called.set(tuple(arguments))
    try:
        yield
    finally:
        _called.reset(token)


def call_to(results: Path) -> list[str]:
    """The command that writes the folder `results`; empty outside of a command."""
    words: list[str] = []
    arguments = iter(_split(_called.get()))
    for word in arguments:
        if word in _DROPPED:
            continue
        if word == "--config":
            words += _settings(Path(next(arguments, "")))
        elif _is(word, results):
            words.append(RESULTS)
        elif words and words[-1] in _OUTPUTS:
            words.append(OUTPUT + Path(word).suffix)
        else:
            words.append(Path(word).name if Path(word).exists() else word)
    return words


def filled(words: Sequence[str], results: Path, output: Path) -> list[str]:
    """A command of `call_to` with its outputs put in."""
    places = {RESULTS: str(results)}
    return [
        str(output) + word.removeprefix(OUTPUT)
        if word.startswith(OUTPUT)
        else places.get(word, word)
        for word in words
    ]


def _split(arguments: Sequence[str]) -> Iterator[str]:
    """`--option=value` as two words, as the rest is read."""
    for argument in arguments:
        name, equals, value = argument.partition("=")
        if equals and name in ("--config", "--output", "--results"):
            yield from (name, value)
        else:
            yield argument


def _is(word: str, folder: Path) -> bool:
    return word == str(folder) or (Path(word).exists() and Path(word).resolve() == folder.resolve())


def _settings(config: Path) -> list[str]:
    """A configuration file as `--set` words, so that the file is not needed again."""
    import tomllib

    try:
        tree = tomllib.loads(config.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    if config.name == "pyproject.toml":
        tree = tree.get("tool", {}).get("seamlog", {})
    return [word for path, value in _leaves(tree) for word in ("--set", f"{path}={value}")]


def _leaves(tree: dict[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", json.dumps(value, default=str)
