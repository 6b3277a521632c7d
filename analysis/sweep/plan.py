"""From grid and ranges to configurations, every one checked before anything is run."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from seamlog.analysis.controllers.own import is_own
from seamlog.analysis.replay.factories import (
    ControllerChoice,
    choose_controller,
    choose_own_controller,
    controller_label,
)
from seamlog.errors import ConfigError, UsageError

from .settings import SweepSettings

MOST_POINTS = 20_000
_SHOWN_FAULTS = 20


@dataclass(frozen=True)
class Point:
    """One configuration of one controller; `varied` holds what the sweep set, by parameter.

    `key` is the same for the same code name and configuration, whatever the sweep.
    """

    choice: ControllerChoice
    varied: dict[str, Any]
    key: str


def make_points(controllers: Sequence[str], settings: SweepSettings) -> list[Point]:
    """All points of a sweep; `ConfigError` with every fault."""
    _check_parameters(controllers, settings)
    points: list[Point] = []
    faults: list[str] = []
    for name in controllers:
        for varied in _variations(controller_label(name), settings):
            try:
                points.append(_point(name, varied, settings))
            except ConfigError as error:
                faults += error.faults
    faults = list(dict.fromkeys(faults))
    if faults:
        listed = "\n".join(f"  {fault}" for fault in faults[:_SHOWN_FAULTS])
        raise ConfigError(f"the sweep has {len(faults)} faults:\n{listed}", tuple(faults))
    return list({point.key: point for point in points}.values())


def _check_parameters(controllers: Sequence[str], settings: SweepSettings) -> None:
    faults: list[str] = []
    labels = [controller_label(name) for name in controllers]
    for name in (*settings.grid, *settings.ranges):
        label, colon, _ = name.partition(":")
        if colon and label not in labels:
            faults.append(f"sweep: {name}: no controller of this sweep is called {label!r}")
    faults += [f"sweep.grid.{name}: no values" for name, of in settings.grid.items() if not of]
    faults += [
        f"sweep.ranges.{name}: {low:g} is not below {high:g}"
        for name, (low, high) in settings.ranges.items()
        if not low < high
    ]
    if bool(settings.ranges) != bool(settings.sobol):
        faults.append("sweep: ranges need a number of Sobol points (--sobol N), and it needs them")
    if not settings.grid and not settings.ranges and len(controllers) < 2:
        faults.append("sweep: nothing is varied; give --grid a=1,2,3 or --range a=1:5 --sobol N")
    if faults:
        raise ConfigError("\n".join(faults), tuple(faults))
    size = len(controllers) * max(1, settings.sobol)
    for values in settings.grid.values():
        size *= len(values)
    if size > MOST_POINTS:
        raise UsageError(f"the sweep has {size} points, at most {MOST_POINTS} are run at once")


def _variations(label: str, settings: SweepSettings) -> Iterator[dict[str, Any]]:
    grid = _own(label, settings.grid)
    ranges = _own(label, settings.ranges)
    for chosen in product(*grid.values()):
        fixed = dict(zip(grid, chosen, strict=True))
        for drawn in _sobol(ranges, settings):
            yield fixed | drawn


def _own(label: str, values: dict[str, Any]) -> dict[str, Any]:
    """Parameters meant for controller `label`, without its prefix."""
    shared = {name: value for name, value in values.items() if ":" not in name}
    prefix = f"{label}:"
    own = {n.removeprefix(prefix): value for n, value in values.items() if n.startswith(prefix)}
    return shared | own


def _sobol(
    ranges: dict[str, tuple[float, float]], settings: SweepSettings
) -> list[dict[str, float]]:
    if not ranges:
        return [{}]
    from scipy.stats import qmc

    sampler = qmc.Sobol(len(ranges), rng=np.random.default_rng(settings.seed))
    unit = sampler.random_base2(int(np.ceil(np.log2(max(2, settings.sobol)))))[: settings.sobol]
    low, high = np.array(list(ranges.values())).T
    return [dict(zip(ranges, row, strict=True)) for row in (low + unit * (high - low)).tolist()]


def _point(name: str, varied: dict[str, Any], settings: SweepSettings) -> Point:
    label = controller_label(name)
    values: dict[str, Any] = json.loads(json.dumps(settings.controllers.get(label, {})))
    for path, value in varied.items():
        *outer, last = path.split(".")
        place = values
        for word in outer:
            place = place.setdefault(word, {})
        place[last] = value
    choose: Callable[..., ControllerChoice] = choose_controller
    code = ""
    if is_own(name):
        choose = choose_own_controller
        source = Path(name.rpartition(":")[0])
        code = hashlib.sha256(source.read_bytes()).hexdigest() if source.is_file() else ""
    choice = choose(name, values)
    text = json.dumps([choice.name, code, choice.config], sort_keys=True)
    return Point(choice, varied, hashlib.sha256(text.encode()).hexdigest())
