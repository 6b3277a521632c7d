"""Fresh controllers and estimators by name; each replay gets its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from pydantic import BaseModel, ValidationError

from seamlog import plugins
from seamlog.contracts import Axis, Controller, Estimator
from seamlog.errors import ConfigError


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


def choose_controller(name: str, values: Mapping[str, Any]) -> ControllerChoice:
    """Find controller `name` and check its configuration (`UnknownName`, `ConfigError`)."""
    factory = plugins.load("seamlog.controllers", name)
    config = _configured(factory.Config, values, f"replay.controllers.{name}")

    def make(axis: Axis, period_s: float) -> Controller:
        return cast(Controller, factory(config, axis, period_s))

    return ControllerChoice(name, config.model_dump(mode="json"), make)


def choose_estimator(name: str, values: Mapping[str, Any]) -> EstimatorChoice:
    """Find estimator `name` and check its configuration (`UnknownName`, `ConfigError`)."""
    factory = plugins.load("seamlog.estimators", name)
    config = _configured(factory.Config, values, f"replay.estimators.{name}")

    def make(period_s: float) -> Estimator:
        return cast(Estimator, factory(config, period_s))

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
