"""Fresh controllers and estimators by name; each replay gets its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from pydantic import BaseModel, ValidationError

from seamlog import plugins
from seamlog.analysis.controllers.guard import make_guarded
from seamlog.analysis.controllers.own import config_of, is_own, load_own, own_class_name
from seamlog.analysis.estimators.guard import make_guarded_estimator
from seamlog.contracts import Axis, Controller, Estimator
from seamlog.errors import ConfigError, UsageError


@dataclass(frozen=True)
class ControllerChoice:
    """A controller to replay: `make(axis, period_s)` gives a fresh one; `config` is JSON-ready."""

    name: str
    config: dict[str, Any]
    make: Callable[[Axis, float], Controller]


@dataclass(frozen=True)
class EstimatorChoice:
    """An estimator to replay: `make(period_s)` gives a fresh one."""

    name: str
    config: dict[str, Any]
    make: Callable[[float], Estimator]


def controller_label(name: str) -> str:
    """How results, topics and settings call controller `name`: that, or `Class` of a file."""
    return own_class_name(name) if is_own(name) else name


def choose_controller(name: str, values: Mapping[str, Any]) -> ControllerChoice:
    """Find controller `name` and check its configuration (`UnknownName`, `ConfigError`).

    Controllers that are not seamlog's own run behind a guard, which raises `PluginFailed`.
    """
    return _choice(name, plugins.load("seamlog.controllers", name), values)


def choose_own_controller(name: str, values: Mapping[str, Any]) -> ControllerChoice:
    """Take the controller from a user's file, `path.py:Class`.

    Only for names that a person gave: a session must not say which file is run.
    """
    label = own_class_name(name)
    if label in plugins.available("seamlog.controllers"):
        raise UsageError(f"{name}: a plug-in is called {label!r} too; rename the class")
    return _choice(label, load_own(name), values)


def _choice(name: str, factory: Any, values: Mapping[str, Any]) -> ControllerChoice:
    config = _configured(config_of(factory), values, f"replay.controllers.{name}")
    trusted = str(getattr(factory, "__module__", "")).startswith("seamlog.")

    def make(axis: Axis, period_s: float) -> Controller:
        if trusted:
            return cast(Controller, factory(config, axis, period_s))
        return make_guarded(factory, config, axis, period_s, name)

    return ControllerChoice(name, config.model_dump(mode="json"), make)


def choose_estimator(name: str, values: Mapping[str, Any]) -> EstimatorChoice:
    """Find estimator `name` and check its configuration (`UnknownName`, `ConfigError`).

    Estimators that are not seamlog's own run behind a guard, which raises `PluginFailed`.
    """
    factory = plugins.load("seamlog.estimators", name)
    config = _configured(factory.Config, values, f"replay.estimators.{name}")

    trusted = str(getattr(factory, "__module__", "")).startswith("seamlog.")

    def make(period_s: float) -> Estimator:
        if trusted:
            return cast(Estimator, factory(config, period_s))
        return make_guarded_estimator(factory, config, period_s, name)

    return EstimatorChoice(name, config.model_dump(mode="json"), make)


def _configured(model: type[BaseModel], values: Mapping[str, Any], where: str) -> BaseModel:
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        faults = tuple(
            ".".join([where, *(str(part) for part in item["loc"])]) + f": {item['msg']}"
            for item in error.errors()
        )
    listed = "\n".join(f"  {fault}" for fault in faults)
    raise ConfigError(f"the configuration has {len(faults)} faults:\n{listed}", faults)
