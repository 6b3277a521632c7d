"""Self-replay to the bit, with and without the extras of the processor, with and without numba.

numpy's SIMD and glibc's FMA variants are switched off in a second process, which has no numba
either; its commands, positions and estimates must hash as ours do.
"""

import hashlib
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from seamlog import plugins
from seamlog.analysis.closed_loop import Reference, simulate
from tests.analysis.axis_bench import AXIS, COULOMB_AXIS, ENCODER_STEP_M, PERIOD_S

PLAIN = {
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable",
    "PYTHONWARNINGS": "ignore",
}
COUNT = 400
FED: dict[str, Any] = {"feed_forward": True}
LAWS: dict[str, tuple[str, dict[str, Any]]] = {
    "paper": ("paper", {}),
    "paper as printed": ("paper", {"form": "as_printed"}),
    "eq. 10": ("smc_sgn", {}),
    "pd": ("pd", FED),
    "pid": ("pid", FED),
    "super-twisting": ("super_twisting", {}),
    "observer": ("disturbance_observer", {}),
    "predictor": ("predictor", {}),
    "adrc": ("adrc", {}),
    "adaptive": ("adaptive", {"adapt_after_s": 2.0}),
    "lqr": ("lqr", {"gains": [8.0, 60.0, 11.0, -0.4]}),
}


def hashes() -> dict[str, str]:
    """One hash per law, of a run on the sliding axis and of one with Stribeck friction."""
    return {title: _hash(*chosen) for title, chosen in LAWS.items()}


def _hash(name: str, values: dict[str, Any]) -> str:
    factory = plugins.load("seamlog.controllers", name)
    config = factory.Config.model_validate(values)
    digest = hashlib.sha256()
    for axis in (COULOMB_AXIS, AXIS):
        run = simulate(
            factory(config, axis, PERIOD_S),
            axis,
            _recorded_reference(),
            PERIOD_S,
            velocity_noise_m_s=np.round(np.random.default_rng(3).uniform(-1e-3, 1e-3, COUNT), 9),
            encoder_step_m=ENCODER_STEP_M,
        )
        for column in (run.command, run.position_m, run.states):
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _recorded_reference() -> Reference:
    """Rounded as a file would hold it: numpy's own sine differs from processor to processor."""
    angle = PERIOD_S * np.arange(COUNT)
    position = np.round(0.1 * np.sin(angle), 9)
    velocity = np.round(0.1 * np.cos(angle), 9)
    return Reference(position, velocity, -position)


@pytest.fixture(scope="module")
def plain(project: os.PathLike[str]) -> dict[str, str]:
    script = (
        "import sys; sys.modules['numba'] = None\n"
        "from tests.analysis.controllers.test_bits import hashes\n"
        "print(*(f'{title}={value}' for title, value in hashes().items()), sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=project,
        env=os.environ | PLAIN,
        capture_output=True,
        text=True,
        check=True,
    )
    pairs = (line.rpartition("=") for line in done.stdout.splitlines() if "=" in line)
    return {title: value for title, _, value in pairs}


@pytest.mark.parametrize("title", LAWS)
def test_the_same_bits_without_the_processors_extras_and_numba(
    plain: dict[str, str], title: str
) -> None:
    assert plain[title] == _hash(*LAWS[title])
