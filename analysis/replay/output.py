"""Replayed outputs beside the original channels, in a new session.

/replay/<controller>/shadow/command           as /table/command
/replay/<controller>/shadow/state             as /controller/state
/replay/<controller>/counterfactual/command   as /table/command
/replay/<controller>/counterfactual/encoder   as /table/encoder
/replay/<controller>/counterfactual/state     as /controller/state
/replay/<estimator>/estimator/state           as /estimator/state
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import COMMAND, ENCODER, FloatArray
from seamlog.channels import CHANNELS
from seamlog.mcap.batch import BatchWriter

from .run import ControllerRun, EstimatorRun, Replay

if TYPE_CHECKING:
    from seamlog.session import Session

_STATES = 8


def write_replay(found: Replay, session: "Session", path: Path, force: bool) -> None:
    """Copy `session` and add the outputs of `found`; `OutputExists` unless `force`."""
    with BatchWriter(path, force) as writer:
        writer.copy_session(session)
        outputs = _Outputs(writer, found, session.channel_metadata(COMMAND))
        for run in found.controllers:
            outputs.write_controller(run)
        for watcher in found.estimators:
            outputs.write_estimator(watcher)


class _Outputs:
    def __init__(self, writer: BatchWriter, found: Replay, drive: dict[str, str]) -> None:
        self._writer, self._record = writer, found.record
        self._drive = {k: v for k, v in drive.items() if k not in ("absent", "producer")}

    def _write(
        self,
        topic: str,
        channel: str,
        columns: dict[str, NDArray[Any]],
        metadata: dict[str, str] | None = None,
    ) -> None:
        self._writer.write_as(
            topic,
            CHANNELS[channel],
            {"stamp_ns": self._record.stamp_ns} | columns,
            log_times_ns=self._record.log_time_ns,
            metadata=metadata or {},
        )

    def write_controller(self, run: ControllerRun) -> None:
        root = f"/replay/{run.choice.name}"
        names = {"names": json.dumps(list(run.state_names))}
        if run.shadow is not None:
            none = np.zeros(len(self._record), dtype=np.bool_)
            columns = {"command": run.shadow.command, "saturated": none}
            absent = {"absent": "saturated"}
            self._write(f"{root}/shadow/command", COMMAND, columns, self._drive | absent)
            self._states(f"{root}/shadow/state", run.shadow.states, names)
        if run.prediction is None:
            return
        loop, root = run.prediction.run, f"{root}/counterfactual"
        columns = {"command": loop.command, "saturated": loop.saturated}
        self._write(f"{root}/command", COMMAND, columns, self._drive)
        motion = {"position_m": loop.position_m, "velocity_m_s": loop.velocity_m_s}
        self._write(f"{root}/encoder", ENCODER, motion)
        self._states(f"{root}/state", loop.states, names)

    def _states(self, topic: str, states: FloatArray, names: dict[str, str]) -> None:
        values = np.full((len(self._record), _STATES), np.nan)
        values[:, : states.shape[1]] = states
        self._write(topic, "/controller/state", {"values": values}, names)

    def write_estimator(self, run: EstimatorRun) -> None:
        trace = run.trace
        names = ("inertia", "viscous_friction", "coulomb_friction")
        columns = {name: trace.parameters[:, place] for place, name in enumerate(names)}
        columns |= {f"var_{name}": trace.variances[:, place] for place, name in enumerate(names)}
        columns["prediction_error"] = trace.prediction_error
        self._write(f"/replay/{run.choice.name}/estimator/state", "/estimator/state", columns)
