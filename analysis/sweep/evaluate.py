"""The points of a sweep predicted from one session, in batches that share their worlds."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seamlog.analysis.axis_record import FloatArray, load_axis_record
from seamlog.analysis.live_controller import LiveController, live_controller
from seamlog.analysis.replay.counterfactual import Prediction, Scene, make_scene, predict_many
from seamlog.analysis.replay.figures import JUDGES, unexplained_miss
from seamlog.analysis.replay.inputs import replay_inputs
from seamlog.analysis.replay.model import identify_model
from seamlog.analysis.replay.part import judged_rows
from seamlog.analysis.replay.run import controller_axis
from seamlog.analysis.replay.self_check import recorded_choice
from seamlog.progress import track
from seamlog.results import Input, input_of
from seamlog.session import open_session

from .plan import Point
from .settings import SweepSettings
from .store import Judged, Store, resume_key

_LOOPS_AT_ONCE = 800
_RECORDED = "recorded"
"""Key of the recorded controller, which tells how well the model predicts."""


@dataclass(frozen=True)
class SessionFigures:
    """One session's figures by point key; `resumed` points had been computed before."""

    path: Path
    inputs: list[Input]
    notes: tuple[str, ...]
    judged: dict[str, Judged]
    resumed: int
    miss: dict[str, float] | None
    """What the model misses of the recorded run, relative; None if that could not be tried."""


def evaluate_session(
    path: Path, points: Sequence[Point], settings: SweepSettings, folder: Path
) -> SessionFigures:
    """Predict what is not in the store yet; the store is saved after each batch."""
    with open_session(path) as session:
        inputs = replay_inputs(load_axis_record(session))
        live = live_controller(session.metadata, str(session.path))
        files = [input_of(file) for file in session.paths]
        rows = judged_rows(inputs.record, session.welds) & ~inputs.filled
    what = {"members": settings.members, "seed": settings.seed}
    store = Store(folder, resume_key([file.sha256 for file in files], what))
    own, _ = recorded_choice(live)
    tried = [*points, *([Point(own, {}, _RECORDED)] if own else [])]
    todo = [point for point in tried if point.key not in store.judged]
    if todo:
        scene = make_scene(inputs.record, identify_model(inputs.record, live))
        batches = list(_batches(todo, settings))
        for batch in track(batches, f"{path.name}: batches of {len(batches[0])}"):
            store.judged |= _judge(batch, scene, live, settings, rows)
            store.save()
    judged = {point.key: store.judged[point.key] for point in points}
    resumed = sum(point not in todo for point in points)
    miss = _miss(store.judged.get(_RECORDED), inputs.record.error_m[rows]) if own else None
    return SessionFigures(path, files, inputs.notes, judged, resumed, miss)


def _miss(found: Judged | None, error_m: FloatArray) -> dict[str, float] | None:
    if found is None or np.isnan(found.rms_mm).any():
        return None
    return {
        kind: unexplained_miss(judge(error_m), found.of(kind)) for kind, judge in JUDGES.items()
    }


def _batches(points: Sequence[Point], settings: SweepSettings) -> Iterator[Sequence[Point]]:
    size = max(1, _LOOPS_AT_ONCE // (settings.members + 1))
    return (points[start : start + size] for start in range(0, len(points), size))


def _judge(
    points: Sequence[Point],
    scene: Scene,
    live: LiveController | None,
    settings: SweepSettings,
    rows: NDArray[np.bool_],
) -> dict[str, Judged]:
    period_s = scene.record.period_s
    makes = [
        partial(point.choice.make, controller_axis(point.choice, live, scene.model), period_s)
        for point in points
    ]
    found = predict_many(makes, scene, settings.members, settings.seed)
    judged = {}
    for point, make, prediction in zip(points, makes, found, strict=True):
        controller = make()
        told = controller.warnings() if hasattr(controller, "warnings") else []
        judged[point.key] = _figures(prediction, rows, tuple(told))
    return judged


def _figures(prediction: Prediction, rows: NDArray[np.bool_], warnings: tuple[str, ...]) -> Judged:
    if not prediction.is_bounded:
        none = np.full(len(prediction.members_m), np.nan)
        return Judged(none, none, warnings)
    rms, peak = (prediction.judged(JUDGES[kind], rows) for kind in ("rms", "peak"))
    return Judged(rms, peak, warnings)
