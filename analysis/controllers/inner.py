"""A plug-in inside another one's configuration: a name and what is set of it."""

from typing import Any, ClassVar, cast

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, field_validator

from seamlog import plugins
from seamlog.contracts import Axis, Controller, Estimator
from seamlog.errors import UsageError

from .guard import MOST_STATES, make_guarded
from .own import config_of


class _Named(BaseModel):
    """`config` is completed with the defaults of the plug-in, so that a record tells all."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    group: ClassVar[str]

    name: str
    config: dict[str, Any] = {}

    @field_validator("config")
    @classmethod
    def _complete(cls, values: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        model = config_of(plugins.load(cls.group, str(info.data.get("name"))))
        try:
            return model.model_validate(values).model_dump(mode="json")
        except ValidationError as error:
            faults = (
                f"{'.'.join(str(part) for part in item['loc'])}: {item['msg']}"
                for item in error.errors()
            )
            raise ValueError("; ".join(faults)) from error

    def _loaded(self) -> tuple[Any, BaseModel]:
        factory = plugins.load(self.group, self.name)
        return factory, config_of(factory).model_validate(self.config)


class InnerController(_Named):
    """A controller by name."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)
    group = "seamlog.controllers"

    def make(self, axis: Axis, period_s: float) -> Controller:
        """A fresh one; others than seamlog's own behind a guard."""
        factory, config = self._loaded()
        if str(factory.__module__).startswith("seamlog."):
            return cast(Controller, factory(config, axis, period_s))
        return make_guarded(factory, config, axis, period_s, self.name)


class InnerEstimator(_Named):
    """An estimator by name."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)
    group = "seamlog.estimators"

    def make(self, period_s: float) -> Estimator:
        """A fresh one."""
        factory, config = self._loaded()
        return cast(Estimator, factory(config, period_s))


def warnings_of(controller: Controller) -> list[str]:
    """The limits that `controller` says it breaks."""
    return list(controller.warnings()) if hasattr(controller, "warnings") else []


def with_state(controller: Controller, name: str) -> tuple[str, ...]:
    """State names of `controller` and one more; `UsageError` if no log could hold them."""
    names = (*controller.state_names, name)
    if len(names) > MOST_STATES:
        raise UsageError(
            f"a wrapper around this controller has {len(names)} states ({', '.join(names)}); at "
            f"most {MOST_STATES} can be logged: wrap fewer"
        )
    return names
