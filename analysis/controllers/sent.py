"""What acts on the axis, known without a sensor: a law's own commands, limited and delayed."""

from seamlog.contracts import Axis


class SentCommands:
    """Queue of the commands under way; nothing acted before the first one."""

    def __init__(self, axis: Axis) -> None:
        self._limit = axis.saturation
        self._waiting = [0.0] * (axis.delay_periods + 1)

    def arrive(self) -> float:
        """What acted over the period before this sample; once per sample, before `send`."""
        return self._waiting.pop(0)

    @property
    def due(self) -> list[float]:
        """After `arrive`: what acts over the next `delay_periods` periods, in order."""
        return self._waiting

    def send(self, wanted: float) -> None:
        """Take this sample's command, before saturation."""
        self._waiting.append(min(max(wanted, -self._limit), self._limit))
