"""The tracking bench: the shipped tunings reach the published table."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seamlog import plugins
from seamlog.analysis.closed_loop import simulate
from tests.analysis.axis_bench import AXIS, ENCODER_STEP_M, PERIOD_S, sine, speed_noise

NOMINAL = replace(
    AXIS,
    inertia=1.02 * AXIS.inertia,
    viscous_friction=0.98 * AXIS.viscous_friction,
    coulomb_friction=0.97 * AXIS.coulomb_friction,
)
TABLE = tomllib.loads(
    (Path(__file__).parents[3] / "benchmarks" / "tracking.toml").read_text(encoding="utf-8")
)["run"]
REFERENCE = sine(0.1, 0.6)


def errors_mm(run: dict[str, Any], seed: int) -> np.ndarray:
    factory = plugins.load("seamlog.controllers", run["controller"])
    controller = factory(factory.Config.model_validate(run["config"]), NOMINAL, PERIOD_S)
    loop = simulate(
        controller,
        AXIS,
        REFERENCE,
        PERIOD_S,
        velocity_noise_m_s=speed_noise(seed),
        encoder_step_m=ENCODER_STEP_M,
    )
    return np.asarray(1e3 * loop.tracking_error_m(REFERENCE)[250:])


@pytest.mark.parametrize(
    "run", [row for row in TABLE if "peak_mm" in row], ids=lambda r: r["title"]
)
def test_each_tuning_reaches_its_row(run: dict[str, Any]) -> None:
    errors = [errors_mm(run, seed) for seed in range(20, 27)]
    assert np.median([np.abs(e).max() for e in errors]) <= run["peak_mm"]
    assert np.median([np.sqrt(np.mean(e**2)) for e in errors]) <= run["rms_mm"]


def test_adrc_beats_every_row_of_the_table_and_is_smooth() -> None:
    run = next(row for row in TABLE if row["controller"] == "adrc")
    error = errors_mm(run, 20)
    assert np.sqrt(np.mean(error**2)) < 0.5 * min(row["rms_mm"] for row in TABLE if "rms_mm" in row)
