"""Configuration: TOML file, `--set a.b=c`, checked as a whole so that all faults come at once."""

import difflib
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from seamlog.errors import ConfigError, InputError

Model = TypeVar("Model", bound=BaseModel)


def load_config(
    model: type[Model], section: str, file: Path | None = None, settings: Sequence[str] = ()
) -> Model:
    """Section `section` of a configuration as `model`.

    `file` is a seamlog.toml, or a pyproject.toml with `[tool.seamlog]`; without one,
    `seamlog.toml` of the working directory is taken if it is there. `settings` are
    `section.key=value` texts that win over the file. Raises `ConfigError` with every fault.
    """
    tree = _read(file) if file else _read_default()
    for setting in settings:
        _apply(tree, setting)
    values = tree.get(section, {})
    try:
        return model.model_validate(values)
    except ValidationError as error:
        faults = tuple(_fault(section, item, model) for item in error.errors())
    where = str(file) if file else "the configuration"
    count = f"{len(faults)} fault{'s' if len(faults) > 1 else ''}"
    raise ConfigError(f"{where} has {count}:\n" + "\n".join(f"  {f}" for f in faults), faults)


def _read_default() -> dict[str, Any]:
    default = Path("seamlog.toml")
    return _read(default) if default.is_file() else {}


def _read(file: Path) -> dict[str, Any]:
    try:
        tree = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such configuration file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file} is not valid TOML: {error}") from error
    if file.name == "pyproject.toml":
        tree = tree.get("tool", {}).get("seamlog", {})
    return dict(tree)


def _apply(tree: dict[str, Any], setting: str) -> None:
    path, equals, text = setting.partition("=")
    keys = path.strip().split(".")
    if not equals or not all(keys):
        raise ConfigError(f"--set {setting!r}: write it as section.key=value")
    for key in keys[:-1]:
        tree = tree.setdefault(key, {})
        if not isinstance(tree, dict):
            raise ConfigError(f"--set {setting!r}: {key} is a value and has no keys below it")
    try:
        tree[keys[-1]] = tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        tree[keys[-1]] = text


def _fault(section: str, item: Any, model: type[BaseModel]) -> str:
    path = ".".join([section, *(str(part) for part in item["loc"])])
    if item["type"] == "extra_forbidden":
        near = difflib.get_close_matches(str(item["loc"][-1]), _keys(model, item["loc"][:-1]), 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"{path}: no such key{hint}"
    return f"{path}: {item['msg'][:1].lower()}{item['msg'][1:]}, got {item['input']!r}"


def _keys(model: type[BaseModel], parents: Sequence[Any]) -> list[str]:
    for parent in parents:
        field = model.model_fields.get(str(parent))
        inner = field.annotation if field else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return []
        model = inner
    return list(model.model_fields)
