"""One replay of a session: several controllers and estimators, shadow and counterfactual."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from seamlog import plugins
from seamlog.analysis.axis_record import AxisRecord
from seamlog.analysis.identification.gated import USUAL_DELAY
from seamlog.analysis.live_controller import LiveController
from seamlog.contracts import Axis
from seamlog.errors import ConfigError, EvidenceError, UsageError
from seamlog.progress import track

from .counterfactual import Prediction, Scene, make_scene, predict
from .factories import (
    ControllerChoice,
    EstimatorChoice,
    choose_controller,
    choose_estimator,
    choose_own_controller,
    controller_label,
)
from .inputs import ReplayInputs
from .model import AxisModel, identify_model
from .self_check import SelfCheck, check_replay, recorded_choice
from .settings import Mode, ReplaySettings
from .shadow import EstimatorTrace, ShadowOutput, shadow_controller, shadow_estimator


@dataclass(frozen=True)
class ControllerRun:
    """What a controller said (shadow) and would have done (prediction)."""

    choice: ControllerChoice
    state_names: tuple[str, ...]
    shadow: ShadowOutput | None
    prediction: Prediction | None
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class EstimatorRun:
    """What an estimator makes of the record."""

    choice: EstimatorChoice
    trace: EstimatorTrace


@dataclass(frozen=True)
class Replay:
    """All that came out; `model` None with `model_reason` where no axis could be identified.

    `recorded` is the prediction of the recorded controller itself, to be held against the record.
    """

    inputs: ReplayInputs
    live: LiveController | None
    model: AxisModel | None
    model_reason: str
    self_check: SelfCheck
    recorded: Prediction | None
    controllers: tuple[ControllerRun, ...]
    estimators: tuple[EstimatorRun, ...]

    @property
    def record(self) -> AxisRecord:
        """The loop that was replayed."""
        return self.inputs.record


def controller_axis(
    choice: ControllerChoice, live: LiveController | None, model: AxisModel | None
) -> Axis:
    """The recorded controller keeps its nominal axis, others get the identified one."""
    if live and choice.name == live.name:
        return live.axis
    if model:
        return model.axis
    if live:
        return live.axis
    raise EvidenceError(
        "no axis is known: the session names none and none could be identified, so a controller "
        "cannot be made; record a run that moves to and fro"
    )


@dataclass(frozen=True)
class _Stage:
    """What all runs of one replay have in common."""

    record: AxisRecord
    model: AxisModel | None
    live: LiveController | None
    mode: Mode
    settings: ReplaySettings

    @cached_property
    def scene(self) -> Scene | None:
        """What a counterfactual keeps of the record; None without a model or in shadow mode."""
        if self.model is None or self.mode == "shadow":
            return None
        return make_scene(self.record, self.model)

    def prediction(self, choice: ControllerChoice) -> Prediction | None:
        if self.scene is None:
            return None
        make = partial(
            choice.make, controller_axis(choice, self.live, self.model), self.record.period_s
        )
        return predict(make, self.scene, self.settings.members, self.settings.seed)

    def shadow(self, choice: ControllerChoice) -> ShadowOutput | None:
        if self.mode == "counterfactual":
            return None
        axis = controller_axis(choice, self.live, self.model)
        controller = choice.make(axis, self.record.period_s)
        return shadow_controller(controller, self.record, axis.saturation)


def replay(
    inputs: ReplayInputs,
    live: LiveController | None,
    controllers: Sequence[str],
    estimators: Sequence[str],
    mode: Mode,
    settings: ReplaySettings,
) -> Replay:
    """Replay `inputs` through the named controllers and estimators.

    Where no axis can be identified the counterfactual is left out with the reason, or refused
    (`EvidenceError`) if it was all that was asked for.
    """
    choices = [_controller(name, live, settings) for name in controllers]
    watchers = [choose_estimator(name, settings.estimators.get(name, {})) for name in estimators]
    model, reason = _model(inputs.record, live, mode)
    stage = _Stage(inputs.record, model, live, mode, settings)
    own, _ = recorded_choice(live)
    delay = model.axis.delay_periods if model else live.axis.delay_periods if live else USUAL_DELAY
    return Replay(
        inputs=inputs,
        live=live,
        model=model,
        model_reason=reason,
        self_check=check_replay(inputs.record, live, model.axis if model else None),
        recorded=stage.prediction(own) if own else None,
        controllers=tuple(_run(choice, stage) for choice in track(choices, "controllers")),
        estimators=tuple(
            EstimatorRun(
                choice, shadow_estimator(choice.make(inputs.record.period_s), inputs.record, delay)
            )
            for choice in watchers
        ),
    )


def check_names(
    controllers: Sequence[str], estimators: Sequence[str], settings: ReplaySettings
) -> None:
    """Find what is named and check its configuration, before anything is read.

    Raises the fault, or one `ConfigError` with all of them.
    """
    acts: list[Callable[[], object]] = [
        *(partial(_controller, name, None, settings) for name in controllers),
        *(partial(choose_estimator, n, settings.estimators.get(n, {})) for n in estimators),
        *(
            partial(plugins.load, "seamlog.controllers", name)
            for name in settings.controllers.keys() - set(map(controller_label, controllers))
        ),
        *(
            partial(plugins.load, "seamlog.estimators", name)
            for name in settings.estimators.keys() - set(estimators)
        ),
    ]
    faults = [fault for fault in map(_fault_of, acts) if fault is not None]
    if len(faults) == 1:
        raise faults[0]
    if faults:
        told = "\n".join(str(fault) for fault in faults)
        raise ConfigError(told, tuple(str(fault) for fault in faults))


def _fault_of(act: Callable[[], object]) -> UsageError | None:
    try:
        act()
    except UsageError as error:
        return error
    return None


def _controller(
    name: str, live: LiveController | None, settings: ReplaySettings
) -> ControllerChoice:
    label = controller_label(name)
    values = settings.controllers.get(label)
    if label != name:
        return choose_own_controller(name, values or {})
    if values is None:
        values = live.config if live and live.name == name else {}
    return choose_controller(name, values)


def _model(
    record: AxisRecord, live: LiveController | None, mode: Mode
) -> tuple[AxisModel | None, str]:
    try:
        return identify_model(record, live), ""
    except EvidenceError as error:
        if mode == "counterfactual":
            raise
        return None, str(error)


def _run(choice: ControllerChoice, stage: _Stage) -> ControllerRun:
    controller = choice.make(
        controller_axis(choice, stage.live, stage.model), stage.record.period_s
    )
    warnings = controller.warnings() if hasattr(controller, "warnings") else []
    return ControllerRun(
        choice=choice,
        state_names=tuple(controller.state_names),
        shadow=stage.shadow(choice),
        prediction=stage.prediction(choice),
        warnings=tuple(warnings),
    )
