"""The run of the virtual cell: table, robot, camera and live loop on one time line."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from seamlog.channels import ARC_OFF, ARC_ON, CLOCK_STEP
from seamlog.contracts import Sink, SourceResult
from seamlog.progress import track

from .bead_photo import render_bead_photo
from .camera import Camera
from .faults import Faults
from .journal import Journal, MovedClock
from .loop import CONTROLLER, LiveLoop, LoopStep
from .process import WeldProcess
from .rig import NOMINAL_AXIS, Table
from .schedule import TICK_S, SpeedDip, make_schedule
from .seam import TrueSeam
from .truth import bead_truth, truth_record
from .view import camera_calibration
from .vision import Scene, Vision

if TYPE_CHECKING:
    from .source import VirtualCellConfig

LOOP_TICKS, CAMERA_TICKS = 2, 5
_PICTURE_LAG_S, _VISION_LAG_S = 0.055, 0.070
_NEVER_S = 1e9
WELD = {
    "part": "demo plate",
    "process": "MAG welding, short arc (ISO 4063: 135-D)",
    "material": "S235JR",
    "thickness_mm": "4",
    "joint": "butt joint, square groove, gap 0.4 mm",
    "position": "PA (ISO 6947)",
    "filler": "G 42 4 M21 3Si1, 1.0 mm",
    "shielding_gas": "M21 (82 % Ar, 18 % CO2), 12 l/min",
    "weld_speed_mm_s": "6",
    "operator": "virtual cell",
}
_AXIS = asdict(NOMINAL_AXIS)
CONTROLLER_RECORD = {
    "name": "adaptive",
    "config": CONTROLLER.model_dump_json(),
    "axis": json.dumps(_AXIS),
}


def _channel_metadata(controller_names: Sequence[str]) -> dict[str, dict[str, str]]:
    return {
        "/table/command": {
            "unit": "N",
            "force_per_unit": "1",
            "force_unit": "N",
            "uncertainty": "0.01",
        },
        "/controller/state": {"names": json.dumps(list(controller_names))},
    }


class Cell:
    """One run: `streams` are independent seeds for the parts that have noise."""

    def __init__(
        self,
        config: "VirtualCellConfig",
        sink: Sink,
        clock: MovedClock,
        streams: Sequence[np.random.SeedSequence],
    ) -> None:
        shape, table, eyes, arc, pictures, photo = map(np.random.default_rng, streams[:6])
        self._config, self._sink, self._photo_rng = config, sink, photo
        self._seam = TrueSeam(shape)
        dip = SpeedDip() if "speed_dip" in config.faults else None
        self._schedule = make_schedule(self._seam, config.identification_s, config.speed_mm_s, dip)
        self._faults = Faults(config.faults, self._schedule)
        self._table = Table(table)
        self._vision = Vision(self._seam, eyes)
        self._process = WeldProcess(arc)
        self._camera = Camera(self._seam, pictures)
        self._loop = LiveLoop(config.identification_s)
        names = self._loop.controller.state_names
        self._journal = Journal(sink, clock, _channel_metadata(names))
        self._seen: list[tuple[float, Scene]] = []

    def run(self) -> SourceResult:
        """Run to the end; logs everything and hands over the bead's photo."""
        schedule = self._schedule
        self._sink.add_metadata("seamlog.weld", WELD)
        self._sink.add_metadata("seamlog.controller", CONTROLLER_RECORD)
        self._sink.attach(
            "calibration/table_from_camera.json", camera_calibration(), "application/json"
        )
        self._plan_events()
        travel_mm = np.empty(schedule.ticks)
        for tick in track(range(schedule.ticks), "virtual cell", schedule.ticks):
            time_s = TICK_S * tick
            travel_mm[tick] = 1e3 * self._table.position_m
            if tick % CAMERA_TICKS == 0:
                self._expose(time_s)
            if tick % LOOP_TICKS == 0:
                self._control(time_s)
            self._table.tick()
            self._journal.flush(time_s)
        self._journal.flush(_NEVER_S)
        return self._finish(travel_mm)

    def _plan_events(self) -> None:
        schedule, put = self._schedule, self._journal.put
        events = [(schedule.arc_on_s, ARC_ON, "arc on"), (schedule.arc_off_s, ARC_OFF, "arc off")]
        stepped_s = self._faults.clock_stepped_s()
        if stepped_s is not None:
            events.append((stepped_s, CLOCK_STEP, "the camera's clock stepped by +0.35 s"))
        for time_s, kind, detail in events:
            put("/events", time_s, time_s + 0.001, kind, detail)

    def _scene(self, time_s: float) -> Scene:
        schedule = self._schedule
        torch_y_mm = schedule.y_at(time_s)
        arc_on = schedule.arc_on_s <= time_s < schedule.arc_off_s
        end_mm = min(torch_y_mm, schedule.y_at(schedule.arc_off_s))
        slip_mm = self._faults.slip_mm(time_s)
        travel_mm = 1e3 * self._table.position_m
        return Scene(time_s, travel_mm, torch_y_mm, arc_on, end_mm, slip_mm)

    def _expose(self, time_s: float) -> None:
        scene = self._scene(time_s)
        if self._faults.loses(time_s):
            return
        self._seen.append((time_s + _VISION_LAG_S, scene))
        stamp_s = self._faults.camera_stamp_s(time_s)
        image = self._camera.picture(scene)
        self._journal.picture(stamp_s, time_s + _PICTURE_LAG_S, image)

    def _control(self, time_s: float) -> None:
        self._take_vision(time_s)
        position_m, velocity_m_s = self._table.measure()
        step = self._loop.step(time_s, position_m, velocity_m_s)
        self._table.send(step.command)
        put = self._journal.put
        if not self._faults.loses(time_s):
            put("/table/encoder", time_s, time_s + 0.002, position_m, velocity_m_s)
        self._log_step(time_s, step)
        schedule = self._schedule
        welding = schedule.arc_on_s <= time_s < schedule.arc_off_s
        values = self._process.sample(time_s - schedule.arc_on_s if welding else None)
        put("/weld/process", time_s, time_s + 0.006, *values)

    def _log_step(self, time_s: float, step: LoopStep) -> None:
        put, controller = self._journal.put, self._loop.controller
        arrives_s = time_s + 0.003
        put("/table/reference", time_s, arrives_s, *step.reference)
        put("/table/command", time_s, arrives_s, step.command, step.saturated)
        state = controller.state()
        put("/controller/state", time_s, arrives_s, [*state, *[np.nan] * (8 - len(state))])
        estimator = controller.estimator
        numbers = (*estimator.parameters(), *estimator.variances(), controller.prediction_error)
        put("/estimator/state", time_s, arrives_s, *numbers)

    def _take_vision(self, time_s: float) -> None:
        while self._seen and self._seen[0][0] <= time_s:
            arrives_s, scene = self._seen.pop(0)
            points, marker = self._vision.seam_points(scene), self._vision.marker(scene)
            stamp_s = self._faults.camera_stamp_s(scene.time_s)
            put = self._journal.put
            put("/seam/points", stamp_s, arrives_s, *points)
            put("/robot/marker", stamp_s, arrives_s, *marker)
            if self._loop.see(scene.time_s, points, marker):
                x_mm, y_mm = self._loop.path.polyline()
                put("/seam/path", stamp_s, arrives_s + 0.005, 1e-3 * x_mm, 1e-3 * y_mm)

    def _finish(self, travel_mm: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> SourceResult:
        times = TICK_S * np.arange(len(travel_mm))
        slip_mm = np.array([self._faults.slip_mm(time_s) for time_s in times])
        bead = bead_truth(self._schedule, self._seam, travel_mm, slip_mm)
        config = self._config
        record = truth_record(bead, self._schedule, self._seam, config.seed, config.faults)
        self._sink.add_metadata("seamlog.truth", record)
        photo, calibration = render_bead_photo(bead, self._seam, self._photo_rng)
        return SourceResult({"bead.jpg": photo, "bead.calibration.json": calibration})
