"""A controller in the user's own file, named as `path.py:Class`."""

import hashlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BaseModel, ConfigDict

from seamlog.errors import InputError, PluginFailed, UsageError

_WANTED = ("output", "state")


class NoConfig(BaseModel):
    """The configuration of a class that declares none: nothing can be set."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def is_own(name: str) -> bool:
    """Whether `name` means a file, not a plug-in."""
    return ".py:" in name or name.endswith(".py")


def own_class_name(name: str) -> str:
    """Class part of `path.py:Class`; `UsageError` if there is none."""
    _, _, class_name = name.rpartition(".py:")
    if not class_name.isidentifier():
        raise UsageError(f"{name!r}: write path.py:Class, such as my_law.py:MyLaw")
    return class_name


def load_own(name: str) -> Any:
    """The class named by `path.py:Class`, checked against the protocol of controllers.

    The file is run under a module name of its own, so it cannot stand in for another module.
    Raises `InputError` (no such file), `UsageError` (no such class, not a controller) and
    `PluginFailed` (the file raises).
    """
    class_name = own_class_name(name)
    path = Path(name[: -len(class_name) - 1])
    if not path.is_file():
        raise InputError(f"{path}: no such file; --controller {name} needs one")
    factory = getattr(_run(path), class_name, None)
    if not isinstance(factory, type):
        raise UsageError(f"{path} defines no class {class_name!r}")
    missing = [word for word in _WANTED if not callable(getattr(factory, word, None))]
    if missing:
        raise UsageError(
            f"{path}: {class_name} is no controller, it lacks {' and '.join(missing)}; "
            "examples/own_controller.py shows one"
        )
    return factory


def config_of(factory: Any) -> type[BaseModel]:
    """`factory.Config`, or an empty one."""
    model = getattr(factory, "Config", NoConfig)
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        raise UsageError(f"{factory.__name__}.Config is no pydantic model")
    return model


def _run(path: Path) -> ModuleType:
    digest = hashlib.sha256(str(path.resolve()).encode()).hexdigest()
    spec = importlib.util.spec_from_file_location(f"_seamlog_own_{digest[:16]}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[spec.name]
        raise PluginFailed(f"{path} cannot be run: {type(error).__name__}: {error}") from error
    return module
