"""What plug-ins look like: the protocols all rooms and other people's packages agree on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

from numpy.typing import NDArray

from seamlog.clock import Clock

Pace = Literal["paced", "simulated"]


@dataclass(frozen=True, slots=True)
class Axis:
    """Model of the table axis, in force units per SI (unit = the command's unit).

    inertia [unit s^2/m], viscous_friction [unit s/m], coulomb_friction [unit], offset [unit],
    static_friction [unit] and stribeck_speed_m_s (0: no Stribeck), saturation [unit] (inf: none),
    delay_periods: whole control periods between a command and its effect. The `_negative` pair is
    for motion towards negative positions; None: as for positive ones.
    """

    inertia: float
    viscous_friction: float
    coulomb_friction: float
    offset: float = 0.0
    static_friction: float = 0.0
    stribeck_speed_m_s: float = 0.0
    stribeck_power: float = 1.0
    saturation: float = float("inf")
    delay_periods: int = 1
    unit: str = "N"
    viscous_friction_negative: float | None = None
    coulomb_friction_negative: float | None = None


class Controller(Protocol):
    """A control law with its state; a factory makes a fresh one for each replay.

    Made as `Factory(config, axis, period_s)`, where `Factory.Config` is a pydantic model.
    """

    @property
    def state_names(self) -> Sequence[str]:
        """Names of the values of `state`."""
        ...

    def output(
        self,
        reference_m: float,
        reference_m_s: float,
        reference_m_s2: float,
        position_m: float,
        velocity_m_s: float,
    ) -> float:
        """Command for the next period, in the axis' command unit, before saturation."""
        ...

    def state(self) -> Sequence[float]:
        """Values for `/controller/state`, in the order of `state_names` (at most eight)."""
        ...


class Estimator(Protocol):
    """An online parameter estimator, fed once per period; made as `Factory(config, period_s)`."""

    def update(self, position_m: float, velocity_m_s: float, applied_command: float) -> float:
        """Take one sample and the command that acted over the period before it.

        Returns the prediction error (predicted - applied, command unit).
        """
        ...

    def parameters(self) -> tuple[float, float, float]:
        """inertia, viscous friction, Coulomb friction."""
        ...

    def variances(self) -> tuple[float, float, float]:
        """Variances of the three (NaN where the method gives none)."""
        ...


class ChannelWriter(Protocol):
    """One channel of a recorder, owned by the thread that asked for it."""

    def put(self, stamp_ns: int, *values: Any) -> bool:
        """Log one message, values in the table's order; False if it was not accepted."""
        ...


class Sink(Protocol):
    """What a source may do with the recorder."""

    def channel(self, topic: str, metadata: Mapping[str, str] | None = None) -> ChannelWriter:
        """The channel of `topic`."""
        ...

    def log_frame(self, topic: str, image: NDArray[Any], stamp_ns: int | None = None) -> bool:
        """Log a picture, uint8, shape (rows, columns) grey or (rows, columns, 3) BGR."""
        ...

    def attach(self, name: str, data: bytes, media_type: str) -> None:
        """Put a file into the session."""
        ...

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Put a metadata record into the session."""
        ...


@dataclass(frozen=True, slots=True)
class SourceResult:
    """What a source hands over when it has ended.

    `files` are to be written beside the session, by suffix: `{"bead.jpg": b"..."}` becomes
    `weld.bead.jpg` beside `weld.mcap`.
    """

    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Device:
    """Something that a source could record: what its configuration calls it, and what it is."""

    address: str
    description: str


class Source(Protocol):
    """A source of live data; made as `Factory(config)`, where `Factory.Config` is a pydantic model.

    The factory may have `drivers`, objects with `is_installed` and `advice` that tell what it
    needs, and `probe() -> list[Device]`.

    `pace` is `paced` (wall clock; drops when the ring is full) or `simulated` (its own `clock`,
    faster than real time; the recorder waits when a ring is full and never drops).
    """

    pace: Pace
    clock: Clock

    def run(self, sink: Sink) -> SourceResult:
        """Log until the source ends or is interrupted."""
        ...


class Importer(Protocol):
    """Reads a foreign file into named columns; the column map does the rest.

    `load` may also give a `Content` (`seamlog.recorder.importers.content`) with units, times and
    notes. An importer of whole recordings has `write(path, writer)` instead, which puts messages
    into a `seamlog.mcap.batch.BatchWriter` and returns a `Report` of the same module.
    """

    def load(self, path: Path) -> Mapping[str, NDArray[Any]]:
        """One-dimensional arrays (or scalars of shape ()) by their name in the file."""
        ...
