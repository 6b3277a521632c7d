"""Replaying a control loop: speed beside its peers, and what the controllers reach.

Speed: 60 s of the 40 ms loop of the axis bench under the paper's law, CPU time, compiled (extra
`fast`) and without numba. Peers: the same loop in 1 ms sub-steps of plain Python, scipy's LSODA
from sample to sample (sign by tanh(v / 1e-4 m/s)), python-control (1 ms map). Tracking: the
tunings of tracking.toml.
"""

import math
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figure, cpu_s, optional_peer, options, tell
from scipy.integrate import solve_ivp

from seamlog import plugins
from seamlog.analysis.batch import simulate_batch
from seamlog.analysis.closed_loop import Reference, simulate
from seamlog.analysis.controllers.adaptive import AdaptiveConfig, AdaptiveController
from seamlog.analysis.controllers.batched import BatchedPaper
from seamlog.analysis.controllers.paper import PaperConfig, PaperController
from seamlog.contracts import Axis

PERIOD_S, COUNT = 0.04, 1500
DURATION_S = PERIOD_S * COUNT
AXIS = Axis(1.0, 2.14, 0.214, 0.0, 0.257, 0.002, saturation=20.0)
SLIDING = Axis(1.0, 2.14, 0.214, saturation=20.0)
"""The same without Stribeck friction: what event steps, sub-steps and LSODA all simulate."""
NOMINAL = replace(AXIS, inertia=1.02, viscous_friction=0.98 * 2.14, coulomb_friction=0.97 * 0.214)
LAW = PaperConfig(surface_slope=4.0, gain=0.257, boundary_layer=0.02)
SETTLED = 250

Loop = Callable[[PaperConfig, int], list[float]]


def reference(amplitude_m: float, rate_1_s: float, count: int = COUNT) -> Reference:
    angle = rate_1_s * PERIOD_S * np.arange(count)
    return Reference(
        amplitude_m * np.sin(angle),
        amplitude_m * rate_1_s * np.cos(angle),
        -amplitude_m * rate_1_s**2 * np.sin(angle),
    )


TRACKING = reference(0.1, 0.6)


def paper_law(config: PaperConfig) -> Callable[..., float]:
    """The paper's law on its own, as a peer would write it."""
    a, b, c = SLIDING.inertia, SLIDING.viscous_friction, SLIDING.coulomb_friction
    slope, gain, layer = config.surface_slope, config.gain or 0.0, config.boundary_layer
    alpha = config.dead_zone_m_s

    def law(xd: float, vd: float, ad: float, x: float, v: float) -> float:
        e, de = xd - x, vd - v
        ratio = (de + slope * e) / layer
        ratio = 1.0 if ratio > 1.0 else -1.0 if ratio < -1.0 else ratio
        shape = 2.0 / math.pi * math.atan((v / alpha) ** 9)
        wanted = ad + 2.0 * slope * de + slope * slope * e
        return b * v + c * shape + a * wanted + gain * ratio

    return law


def samples(count: int) -> list[tuple[float, float, float]]:
    ref = TRACKING
    columns = (ref.position_m, ref.velocity_m_s, ref.acceleration_m_s2)
    return list(zip(*(column[:count].tolist() for column in columns), strict=True))


def substeps(config: PaperConfig, count: int) -> list[float]:
    """The loop in 40 sub-steps of 1 ms, friction implicit, everything in one loop."""
    law, step = paper_law(config), PERIOD_S / 40
    damping = 1.0 + step * SLIDING.viscous_friction / SLIDING.inertia
    hold = step * SLIDING.coulomb_friction / SLIDING.inertia
    limit, x, v, acting = SLIDING.saturation, 0.0, 0.06, 0.0
    positions = []
    for xd, vd, ad in samples(count):
        positions.append(x)
        command = min(max(law(xd, vd, ad, x, v), -limit), limit)
        push = step * acting / SLIDING.inertia
        for _ in range(40):
            impulse = v + push
            if impulse > hold:
                after = (impulse - hold) / damping
            elif impulse < -hold:
                after = (impulse + hold) / damping
            else:
                after = 0.0
            x += 0.5 * step * (v + after)
            v = after
        acting = command
    return positions


def stribeck_substeps(config: PaperConfig, count: int) -> list[float]:
    """The loop in 40 sub-steps of 1 ms on the whole axis of the bench, a function per sub-step."""
    law, step, axis = paper_law(config), PERIOD_S / 40, AXIS
    excess = axis.static_friction - axis.coulomb_friction

    def advance(x: float, v: float, u: float) -> tuple[float, float]:
        fall = math.exp(-((abs(v) / axis.stribeck_speed_m_s) ** axis.stribeck_power))
        hold = step * (axis.coulomb_friction + excess * fall) / axis.inertia
        damping = 1.0 + step * axis.viscous_friction / axis.inertia
        impulse = v + step * u / axis.inertia
        after = (impulse - max(-hold, min(hold, impulse))) / damping
        return x + 0.5 * step * (v + after), after

    limit, x, v, acting, positions = axis.saturation, 0.0, 0.06, 0.0, []
    for xd, vd, ad in samples(count):
        positions.append(x)
        command = min(max(law(xd, vd, ad, x, v), -limit), limit)
        for _ in range(40):
            x, v = advance(x, v, acting)
        acting = command
    return positions


def lsoda(config: PaperConfig, count: int) -> list[float]:
    """The loop by scipy's solve_ivp from sample to sample."""
    law, limit, acting = paper_law(config), SLIDING.saturation, 0.0
    a, b, c = SLIDING.inertia, SLIDING.viscous_friction, SLIDING.coulomb_friction
    state, positions = np.array([0.0, 0.06]), []
    for xd, vd, ad in samples(count):
        x, v = state.tolist()
        positions.append(x)
        command = min(max(law(xd, vd, ad, x, v), -limit), limit)

        def slope(_: float, y: Any, u: float = acting) -> list[float]:
            return [y[1], (u - b * y[1] - c * math.tanh(y[1] / 1e-4)) / a]

        found = solve_ivp(slope, (0.0, PERIOD_S), state, method="LSODA", rtol=1e-6, atol=1e-9)
        state, acting = found.y[:, -1], command
    return positions


def python_control(config: PaperConfig, count: int) -> list[float]:
    """The loop as a discrete system of 1 ms in python-control."""
    import control

    law, step = paper_law(config), PERIOD_S / 40
    damping = 1.0 + step * SLIDING.viscous_friction / SLIDING.inertia
    hold = step * SLIDING.coulomb_friction / SLIDING.inertia

    def update(_: float, state: Any, asked: Any, __: Any) -> list[float]:
        x, v, acting, waiting, tick = state.tolist()
        if round(tick) % 40 == 0:
            acting, waiting = waiting, law(*asked.tolist(), x, v)
        impulse = v + step * acting / SLIDING.inertia
        after = (impulse - min(max(impulse, -hold), hold)) / damping
        return [x + 0.5 * step * (v + after), after, acting, waiting, tick + 1]

    system = control.nlsys(update, None, inputs=3, outputs=5, states=5, dt=step)
    time_s = np.arange(40 * count) * step
    asked = np.repeat(np.array(samples(count)).T, 40, axis=1)
    found = control.input_output_response(system, time_s, asked, [0.0, 0.06, 0.0, 0.0, 0.0])
    return list(found.outputs[0, ::40])


class Interpreted:
    """Hides that `controller` is a pure function, so that its loop is not compiled."""

    def __init__(self, controller: PaperController) -> None:
        self.state_names = controller.state_names
        self.output, self.state = controller.output, controller.state


def paper() -> PaperController:
    return PaperController(LAW, SLIDING, PERIOD_S)


def event_steps(controller: Any) -> Any:
    return simulate(controller, SLIDING, TRACKING, PERIOD_S).position_m


def noise(seed: int) -> Any:
    return 5e-4 * np.random.default_rng(seed).standard_normal(COUNT)


def speed_figures(quick: bool) -> list[Figure]:
    count = 150 if quick else COUNT
    per_sample = COUNT / count
    first_s = cpu_s(lambda: event_steps(paper()), 1)
    ours_s = cpu_s(lambda: event_steps(paper()), 100)
    plain_ours_s = cpu_s(lambda: event_steps(Interpreted(paper())), 30)
    plain_s = cpu_s(lambda: substeps(LAW, count), 5) * per_sample
    full_s = cpu_s(lambda: stribeck_substeps(LAW, count), 5) * per_sample
    lsoda_s = cpu_s(lambda: lsoda(LAW, count), 1 if quick else 2) * per_sample
    figures = [
        Figure("60 s of the loop, event steps, compiled", 1e3 * ours_s, "ms"),
        Figure("its first run, numba and machine code loaded", first_s, "s"),
        Figure("1 ms sub-steps of plain Python, no Stribeck", plain_s / ours_s, "x", ">= 30"),
        Figure("1 ms sub-steps of plain Python", full_s / ours_s, "x", ">= 30"),
        Figure("LSODA", lsoda_s / ours_s, "x", ">= 200"),
        Figure("60 s of the loop without numba", 1e3 * plain_ours_s, "ms"),
        Figure("1 ms sub-steps over it", full_s / plain_ours_s, "x"),
        Figure("LSODA over it", lsoda_s / plain_ours_s, "x"),
    ]
    with optional_peer("python-control"):
        peer_s = cpu_s(lambda: python_control(LAW, count // 10), 1) * 10 * per_sample
        figures.append(Figure("python-control, 1 ms map", peer_s / ours_s, "x"))
    difference = np.abs(event_steps(paper())[:count] - substeps(LAW, count)).max()
    figures.append(Figure("difference to 1 ms sub-steps", 1e3 * float(difference), "mm"))
    return figures + logged_figures() + batch_figures(10 if quick else 1000)


def logged_figures() -> list[Figure]:
    """With noise, quantised encoder, saturation and a log row per sample, as a replay runs."""

    def run(made: Any) -> float:
        seen = noise(1)
        return DURATION_S / cpu_s(
            lambda: simulate(
                made(),
                SLIDING,
                TRACKING,
                PERIOD_S,
                velocity_noise_m_s=seen,
                encoder_step_m=1e-6,
            ),
            30,
        )

    compiled = run(paper)
    plain = run(lambda: Interpreted(paper()))
    adaptive = run(lambda: AdaptiveController(AdaptiveConfig(law=LAW), SLIDING, PERIOD_S))
    return [
        Figure("noise and log rows, compiled", compiled, "x real", ">= 25000"),
        Figure("plug-in controller, noise and log rows", plain, "x real", ">= 25000"),
        Figure("adaptive with the default estimator", adaptive, "x real", ">= 5000"),
    ]


def batch_figures(width: int) -> list[Figure]:
    """Random tunings of the paper's law, all at once; LSODA extrapolated from five."""
    random = np.random.default_rng(0)
    tunings = [
        PaperConfig(
            surface_slope=random.uniform(1, 12),
            gain=random.uniform(0.02, 1),
            boundary_layer=random.uniform(0.005, 0.4),
        )
        for _ in range(width)
    ]
    axes = [SLIDING] * width
    batch_s = cpu_s(
        lambda: simulate_batch(BatchedPaper(tunings, axes), axes, TRACKING, PERIOD_S), 3
    )
    few = cpu_s(lambda: [lsoda(config, COUNT // 10) for config in tunings[:5]], 1)
    plain = cpu_s(lambda: substeps(tunings[0], COUNT), 3)
    return [
        Figure(f"{width} configurations x 60 s, batched", batch_s, "s", "<= 0.5"),
        Figure("1 ms sub-steps over the batch", plain * width / batch_s, "x"),
        Figure("LSODA over the batch", few * 10 * width / 5 / batch_s, "x", ">= 500"),
    ]


def errors_mm(run: dict[str, Any], seed: int) -> Any:
    factory = plugins.load("seamlog.controllers", run["controller"])
    controller = factory(factory.Config.model_validate(run["config"]), NOMINAL, PERIOD_S)
    loop = simulate(
        controller,
        AXIS,
        TRACKING,
        PERIOD_S,
        velocity_noise_m_s=noise(seed),
        encoder_step_m=1e-6,
    )
    return 1e3 * loop.tracking_error_m(TRACKING)[SETTLED:], float(np.diff(loop.command).std())


def tracking_figures(quick: bool) -> list[Figure]:
    """Median over noise seeds of peak and rms after 10 s, and the roughness of the command."""
    table = tomllib.loads(Path(__file__).with_name("tracking.toml").read_text(encoding="utf-8"))
    figures = []
    for run in table["run"]:
        runs = [errors_mm(run, seed) for seed in range(1 if quick else 5)]
        peak = float(np.median([np.abs(error).max() for error, _ in runs]))
        rms = float(np.median([np.sqrt(np.mean(error**2)) for error, _ in runs]))
        for word, value in (("peak", peak), ("rms", rms)):
            bound = run.get(f"{word}_mm")
            target = f"<= {bound}" if bound else ""
            figures.append(Figure(f"{run['title']}, {word}", value, "mm", target))
        rough = float(np.median([rough for _, rough in runs]))
        figures.append(Figure(f"{run['title']}, sd of du", rough, "N"))
    return figures


def main() -> None:
    given = options(__doc__)
    tell("Replay: speed", speed_figures(given.quick), given.json)
    tell("Replay: tracking bench", tracking_figures(given.quick), given.json)


if __name__ == "__main__":
    main()
