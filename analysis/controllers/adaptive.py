"""The paper's live loop: its law, tuned each period by an estimator in the same loop."""

from pydantic import BaseModel, ConfigDict, Field

from seamlog.contracts import Axis

from .inner import InnerEstimator
from .paper import PaperConfig, PaperController
from .sent import SentCommands


class AdaptiveConfig(BaseModel):
    """Law, estimator, and when the law begins to follow the estimator."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    law: PaperConfig = PaperConfig()
    estimator: InnerEstimator = InnerEstimator(name="gated_rls")
    adapt_after_s: float = Field(5.0, ge=0)
    """Until then the law keeps the axis' nominal parameters."""


class AdaptiveController:
    """Self-tuning control: `estimator` sees what acted on the axis, `law` uses what it says.

    The command that acted is known without a sensor: the own output of `delay_periods` earlier,
    after saturation. Estimates that make no physical sense (inertia or friction not above 0)
    are not taken over.
    """

    Config = AdaptiveConfig
    state_names = PaperController.state_names

    def __init__(self, config: AdaptiveConfig, axis: Axis, period_s: float) -> None:
        self.law = PaperController(config.law, axis, period_s)
        self.estimator = config.estimator.make(period_s)
        self.prediction_error = float("nan")
        self._sent = SentCommands(axis)
        self._quiet_periods = round(config.adapt_after_s / period_s)

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Update the estimator with this sample, the law with the estimate, then the law."""
        applied = self._sent.arrive()
        self.prediction_error = self.estimator.update(position_m, velocity_m_s, applied)
        if self._quiet_periods > 0:
            self._quiet_periods -= 1
        else:
            self._adapt()
        wanted = self.law.output(
            reference_m, reference_m_s, reference_m_s2, position_m, velocity_m_s
        )
        self._sent.send(wanted)
        return wanted

    def _adapt(self) -> None:
        inertia, viscous, coulomb = self.estimator.parameters()
        if inertia > 0.0 and viscous >= 0.0 and coulomb >= 0.0:
            self.law.adapt(inertia, viscous, coulomb)

    def state(self) -> tuple[float, ...]:
        """Values in the order of `state_names`."""
        return self.law.state()

    def warnings(self) -> list[str]:
        """Those of the law on the nominal axis."""
        return self.law.warnings()
