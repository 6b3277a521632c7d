"""Control loops with known truth, as records and as sessions."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord, Drive
from seamlog.analysis.closed_loop import Reference, simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.contracts import Axis
from seamlog.mcap.batch import BatchWriter

PERIOD_S = 0.04
TRUTH = Axis(1.0, 2.14, 0.214, saturation=20.0, unit="N m")
LAW = PaperConfig(surface_slope=4.0, boundary_layer=0.1)

MakeLoop = Callable[..., AxisRecord]


def sine_reference(seconds: float, amplitude_m: float = 0.1, rate_1_s: float = 1.0) -> Reference:
    phase = rate_1_s * PERIOD_S * np.arange(round(seconds / PERIOD_S))
    return Reference(
        amplitude_m * np.sin(phase),
        amplitude_m * rate_1_s * np.cos(phase),
        -amplitude_m * rate_1_s**2 * np.sin(phase),
    )


def record_loop(
    reference: Reference | None = None,
    truth: Axis = TRUTH,
    controller: Any = None,
    speed_noise_m_s: float = 5e-4,
    seed: int = 0,
) -> AxisRecord:
    """One run of the paper's law (or `controller`) on `truth`, as the control loop saw it."""
    reference = reference or sine_reference(30.0)
    count = len(reference.position_m)
    noise = np.random.default_rng(seed).normal(0.0, speed_noise_m_s, count)
    run = simulate(
        controller or PaperController(LAW, truth, PERIOD_S),
        truth,
        reference,
        PERIOD_S,
        velocity_noise_m_s=noise,
        encoder_step_m=1e-6,
    )
    stamp_ns = 1_700_000_000_000_000_000 + 40_000_000 * np.arange(count)
    return AxisRecord(
        stamp_ns=stamp_ns,
        log_time_ns=stamp_ns,
        position_m=run.measured_position_m,
        velocity_m_s=run.measured_velocity_m_s,
        reference_m=reference.position_m,
        reference_m_s=reference.velocity_m_s,
        reference_m_s2=reference.acceleration_m_s2,
        command=run.command,
        saturated=run.saturated,
        drive=Drive(truth.unit),
        period_s=PERIOD_S,
    )


def write_loop(
    path: Path,
    record: AxisRecord,
    metadata: dict[str, dict[str, str]] | None = None,
    drive: dict[str, str] | None = None,
) -> Path:
    """A session of encoder, reference and command."""
    stamp = {"stamp_ns": record.stamp_ns}
    motion = {"position_m": record.position_m, "velocity_m_s": record.velocity_m_s}
    asked = {
        "position_m": record.reference_m,
        "velocity_m_s": record.reference_m_s,
        "acceleration_m_s2": record.reference_m_s2,
    }
    sent = {"command": record.command, "saturated": record.saturated}
    with BatchWriter(path) as writer:
        for name, values in (metadata or {}).items():
            writer.add_metadata(name, values)
        writer.write("/table/encoder", stamp | motion)
        writer.write("/table/reference", stamp | asked)
        writer.write("/table/command", stamp | sent, metadata=drive or {"unit": "N m"})
    return path


@pytest.fixture
def loop() -> MakeLoop:
    return record_loop


@pytest.fixture
def session_of(tmp_path: Path) -> Callable[..., Path]:
    def make(record: AxisRecord, name: str = "loop.mcap", **options: Any) -> Path:
        return write_loop(tmp_path / name, record, **options)

    return make
