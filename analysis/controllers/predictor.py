"""A predictor around any controller: it sees the motion at the moment its command will act."""

from dataclasses import replace

from pydantic import BaseModel, ConfigDict

from seamlog.analysis.coulomb_plant import CoulombPlant
from seamlog.contracts import Axis

from .inner import InnerController, warnings_of, with_state
from .sent import SentCommands


class PredictorConfig(BaseModel):
    """What runs on the predicted motion."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    controller: InnerController = InnerController(name="pd", config={"feed_forward": True})


class Predictor:
    """Steps model and reference over the delay; the inner controller then has none.

    The model is the axis with its exact step and the commands under way; the reference goes on
    with its present acceleration.
    """

    Config = PredictorConfig

    def __init__(self, config: PredictorConfig, axis: Axis, period_s: float) -> None:
        self._axis, self._period_s = axis, period_s
        self._inner = config.controller.make(replace(axis, delay_periods=0), period_s)
        self._plant = CoulombPlant(axis, period_s)
        self._sent = SentCommands(axis)
        self._ahead_s = axis.delay_periods * period_s
        self._predicted_m = 0.0
        self.state_names = with_state(self._inner, "predicted_position_m")

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command before saturation."""
        self._sent.arrive()
        for command in self._sent.due:
            position_m, velocity_m_s = self._plant.step(position_m, velocity_m_s, command)
        self._predicted_m, ahead_s = position_m, self._ahead_s
        wanted = self._inner.output(
            reference_m + ahead_s * (reference_m_s + 0.5 * ahead_s * reference_m_s2),
            reference_m_s + ahead_s * reference_m_s2,
            reference_m_s2,
            position_m,
            velocity_m_s,
        )
        self._sent.send(wanted)
        return wanted

    def state(self) -> tuple[float, ...]:
        """States of the inner controller (about the predicted moment) and the prediction."""
        return (*self._inner.state(), self._predicted_m)

    def warnings(self) -> list[str]:
        """Those of the inner controller (on the axis without delay), or that there is none."""
        if self._axis.delay_periods == 0:
            return ["the axis has no delay: the predictor does nothing", *warnings_of(self._inner)]
        return warnings_of(self._inner)
