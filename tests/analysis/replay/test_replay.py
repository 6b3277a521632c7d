"""Replay: what was recorded is reproduced, what is predicted comes true, the rest is refused."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from seamlog.analysis.axis_record import AxisRecord, load_axis_record
from seamlog.analysis.closed_loop import ClosedLoop, Reference, simulate
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.analysis.controllers.pd import PD, PDConfig
from seamlog.analysis.estimators.gated_rls import GatedRLS, GatedRLSConfig
from seamlog.analysis.replay.abduction import abduce, reproduce
from seamlog.analysis.replay.counterfactual import make_scene, predict
from seamlog.analysis.replay.figures import rms_mm
from seamlog.analysis.replay.inputs import replay_inputs
from seamlog.analysis.replay.model import identify_model
from seamlog.analysis.replay.shadow import shadow_controller, shadow_estimator
from seamlog.analysis.stribeck_plant import Ripple, StribeckPlant
from seamlog.cli import run
from seamlog.contracts import Axis, Controller
from seamlog.errors import EvidenceError
from seamlog.results import Results
from seamlog.session import open_session

MakeLoop = Callable[..., AxisRecord]
PERIOD_S = 0.04
TRUTH = Axis(1.0, 2.14, 0.214, saturation=20.0, unit="N m")
LAW = PaperConfig(surface_slope=4.0, boundary_layer=0.1)


def bench_reference(seconds: float = 60.0) -> Reference:
    """50 sin 0.6t + 20 sin(1.1t + 1) mm."""
    t = PERIOD_S * np.arange(round(seconds / PERIOD_S))
    slow, fast = 0.6 * t, 1.1 * t + 1
    return Reference(
        0.05 * np.sin(slow) + 0.02 * np.sin(fast),
        0.03 * np.cos(slow) + 0.022 * np.cos(fast),
        -0.018 * np.sin(slow) - 0.0242 * np.sin(fast),
    )


def controller_metadata(axis: Axis = TRUTH) -> dict[str, dict[str, str]]:
    values = {"name": "paper", "config": LAW.model_dump_json(), "axis": json.dumps(asdict(axis))}
    return {"seamlog.controller": values}


@pytest.mark.parametrize("axis", [TRUTH, Axis(2.0, 0.5, 0.4, unit="N m")])
def test_abduction_reproduces_commands_and_positions(loop: MakeLoop, axis: Axis) -> None:
    record = loop()
    own = PaperController(LAW, TRUTH, PERIOD_S)
    again = reproduce(abduce(record, axis), record, replace(axis, saturation=20.0), own)
    assert np.max(np.abs(again.command - record.command)) < 1e-12
    assert np.max(np.abs(again.measured_position_m - record.position_m)) < 1e-12


def test_the_recorded_controller_in_the_shadow_says_the_recorded_commands(loop: MakeLoop) -> None:
    record = loop()
    shadow = shadow_controller(PaperController(LAW, TRUTH, PERIOD_S), record, 20.0)
    np.testing.assert_array_equal(shadow.command, record.command)


def test_an_estimator_in_the_shadow_finds_the_truth(loop: MakeLoop) -> None:
    trace = shadow_estimator(GatedRLS(GatedRLSConfig(), PERIOD_S), loop(), 1)
    np.testing.assert_allclose(trace.parameters[-1], [1.0, 2.14, 0.214], rtol=0.02)


def test_the_same_seed_gives_the_same_band(loop: MakeLoop) -> None:
    record = loop()
    scene = make_scene(record, identify_model(record, None))

    def make() -> PD:
        return PD(PDConfig(), TRUTH, PERIOD_S)

    one, other, third = (predict(make, scene, 3, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.members_m, other.members_m)
    assert not np.array_equal(one.members_m, third.members_m)


@pytest.mark.parametrize("seed", range(2))
def test_another_controller_is_predicted(loop: MakeLoop, seed: int) -> None:
    """Truth with Stribeck friction, ripple and drift; the model knows nothing of them."""
    truth = Axis(1.0, 2.14, 0.214, 0.0, 0.257, 0.002, saturation=20.0, unit="N m")
    plant = StribeckPlant(truth, PERIOD_S, 40, Ripple(0.03, 0.01))
    reference = bench_reference()
    count = len(reference.position_m)
    drift = 0.03 * np.sin(2 * np.pi * PERIOD_S * np.arange(count) / 37)

    def true_run(controller: Controller, run_seed: int) -> ClosedLoop:
        noise = np.random.default_rng(run_seed).normal(0, 5e-4, count)
        return simulate(
            controller,
            truth,
            reference,
            PERIOD_S,
            plant=plant,
            velocity_noise_m_s=noise,
            disturbance=drift,
            encoder_step_m=1e-6,
        )

    law = PaperConfig(surface_slope=4.0, boundary_layer=0.02)
    recorded = true_run(PaperController(law, truth, PERIOD_S), seed)
    record = replace(
        loop(reference=reference),
        position_m=recorded.measured_position_m,
        velocity_m_s=recorded.measured_velocity_m_s,
        command=recorded.command,
    )
    scene = make_scene(record, identify_model(record, None))
    late = np.arange(count) >= 250
    misses = []
    for kp, kd, feed_forward in ((10, 4, True), (20, 8, False), (35, 8, True), (35, 8, False)):
        config = PDConfig(kp=kp, kd=kd, feed_forward=feed_forward)
        truly = true_run(PD(config, truth, PERIOD_S), 100 + seed)
        true_rms = rms_mm(truly.tracking_error_m(reference)[late])
        found = predict(partial(PD, config, truth, PERIOD_S), scene, 2, 0)
        misses.append(abs(rms_mm(found.error_m[late]) / true_rms - 1))
    assert np.median(misses) < 0.03
    assert max(misses) < 0.10


def test_missing_messages_are_filled_and_told(loop: MakeLoop) -> None:
    record = loop()
    kept = np.ones(len(record), dtype=np.bool_)
    kept[[50, 51, 200]] = False
    inputs = replay_inputs(record.rows(kept))
    assert len(inputs.record) == len(record)
    assert any("3 missing control periods" in note for note in inputs.notes)
    np.testing.assert_allclose(inputs.record.position_m, record.position_m, atol=1e-3)


def test_a_whole_record_is_replayed_as_it_is(loop: MakeLoop) -> None:
    record = loop()
    inputs = replay_inputs(record)
    assert inputs.notes == ()
    np.testing.assert_array_equal(inputs.record.velocity_m_s, record.velocity_m_s)


def test_too_much_missing_is_refused(loop: MakeLoop) -> None:
    record = loop()
    kept = np.random.default_rng(0).random(len(record)) > 0.1
    with pytest.raises(EvidenceError, match="would be invented"):
        replay_inputs(record.rows(kept))


def test_outputs_stand_beside_the_originals(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    path = session_of(loop(), metadata=controller_metadata())
    out = tmp_path / "replay.mcap"
    names = ["--controller", "pd", "--controller", "paper", "--estimator", "gated_rls"]
    few = ["--set", "replay.members=3", "--results", str(tmp_path / "r")]
    assert run(["replay", str(path), *names, *few, "-o", str(out)]) == 0
    with open_session(path) as before, open_session(out) as after:
        for topic in before.info.channels:
            for name, column in before.columns(topic).items():
                np.testing.assert_array_equal(after.columns(topic)[name], column)
        shadow = after.columns("/replay/paper/shadow/command")["command"]
        np.testing.assert_array_equal(shadow, before.columns("/table/command")["command"])
        assert "/replay/pd/counterfactual/encoder" in after.info.channels
        assert "/replay/gated_rls/estimator/state" in after.info.channels
    part = Results.open(tmp_path / "r").parts()[0]
    assert {"recorded", "pd", "paper", "gated_rls"} == set(part.tables)
    check = part.figure("self_check_command_difference")
    assert check is not None and isinstance(check.value, float) and check.value < 1e-12
    assert any("predicts no tracking error" in finding.message for finding in part.findings)


def test_a_shadow_replay_gives_no_error(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    path = session_of(loop(), metadata=controller_metadata())
    words = ["replay", str(path), "--controller", "pd", "--mode", "shadow"]
    results = tmp_path / "r"
    assert run([*words, "-o", str(tmp_path / "o.mcap"), "--results", str(results)]) == 0
    figure = Results.open(results).parts()[0].figure("pd_rms_error_mm")
    assert figure is not None and figure.value is None and "shadow" in figure.reason


def test_an_unknown_recorded_controller_is_told(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    path = session_of(loop())
    words = ["replay", str(path), "--controller", "pd", "--set", "replay.members=2"]
    results = tmp_path / "r"
    assert run([*words, "-o", str(tmp_path / "o.mcap"), "--results", str(results)]) == 0
    figure = Results.open(results).parts()[0].figure("self_check_command_difference")
    assert figure is not None and figure.value is None
    assert "which controller was live" in figure.reason


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([], 2, "--controller NAME or --estimator NAME"),
        (["--controller", "pdd"], 2, "Did you mean 'pd'?"),
        (["--controller", "pd", "--set", "replay.controllers.pd.kp=-1"], 2, "controllers.pd.kp"),
        (["--controller", "pd", "--set", "replay.member=3"], 2, "did you mean members?"),
    ],
)
def test_bad_requests_write_nothing(
    loop: MakeLoop,
    session_of: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    code: int,
    message: str,
) -> None:
    path = session_of(loop())
    assert run(["replay", str(path), *words, "-o", str(tmp_path / "o.mcap")]) == code
    assert message in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_a_session_without_reference_is_refused(
    loop: MakeLoop, session_of: Callable[..., Path], tmp_path: Path
) -> None:
    record = loop()
    blind = replace(record, reference_m=np.full(len(record), np.nan))
    path = session_of(blind)
    with open_session(path) as session:
        assert not load_axis_record(session).has_reference
    assert run(["replay", str(path), "--controller", "pd", "-o", str(tmp_path / "o.mcap")]) == 6
