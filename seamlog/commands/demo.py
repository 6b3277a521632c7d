"""`seamlog demo`: a virtual weld with a planted fault through the whole chain, over files."""

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from seamlog.command import command, force_option, output_option
from seamlog.errors import EvidenceError, SeamlogError
from seamlog.files import check_output, write_bytes
from seamlog.outcome import Ending, Outcome
from seamlog.progress import spinner
from seamlog.results import Part, Results

PLACE_TOLERANCE_MM = 10.0
"""How far from the planted place the join may point: about two bead widths."""


CONFIGURATION = """\
# What the demo's commands are given with --config. Limits are the user's own: here those of an
# imaginary drawing; without them nothing is judged.
[limits]
tracking_error_mm = 1.0

[bead]
min_width_mm = 5.0
max_width_mm = 7.0

# Alternatives to the controller that welded. Below 2 mm/s a friction shape at the measured speed
# does nothing, so both compensate friction at the reference's speed.
[replay.controllers.paper]
friction_speed = "reference"
dead_zone_m_s = 0.0001

[replay.controllers.pd]
feed_forward = true
"""


@dataclass(frozen=True, slots=True)
class _Step:
    name: str
    seconds: float
    note: str


@command()
@output_option("Folder for the session, the results and the report.")
@force_option
def demo(output: Path, force: bool) -> Outcome:
    """Weld virtually, record, analyse, replay and report.

    Ends well when the chain ran and the cause planted in the virtual weld was found, whatever
    the verdict on the weld.
    """
    report = output / "report.html"
    output.mkdir(parents=True, exist_ok=True)
    check_output(report, force)
    write_bytes(output / "seamlog.toml", CONFIGURATION.encode())
    steps = [_run(arguments) for arguments in _chain(output)]
    found, sentence = _compare(output / "weld.mcap", Results.open(output / "weld.results"))
    lines = [f"  {step.name:<8} {step.seconds:5.1f} s  {step.note}" for step in steps]
    lines += ["", sentence, f"Open {report} in a browser."]
    document = {
        "report": str(report),
        "steps": [{"command": step.name, "seconds": round(step.seconds, 3)} for step in steps],
        "planted_cause_found": found,
    }
    ending = Ending.PASS if found else Ending.FINDING
    return Outcome("seamlog.demo", "\n".join(lines), document, ending)


def _chain(folder: Path) -> list[list[str]]:
    session, results = str(folder / "weld.mcap"), str(folder / "weld.results")
    photo, calibration = str(folder / "weld.bead.jpg"), str(folder / "weld.bead.calibration.json")
    replayed, report = str(folder / "replay.mcap"), str(folder / "report.html")
    controllers = ["--controller", "paper", "--controller", "pd", "--estimator", "gated_rls"]
    given = ["--config", str(folder / "seamlog.toml"), "--force"]
    into = ["-o", results]
    return [
        ["record", "--source", "virtual-cell", "-o", session, "--force"],
        ["attach", session, photo, calibration, "--force"],
        ["identify", session, *into, "--force"],
        ["replay", session, *controllers, "--results", results, "-o", replayed, *given],
        ["bead", "measure", "--session", session, "--start", "left", *into, *given],
        ["analyze", session, "--start", "left", *into, *given],
        ["report", results, "-o", report, "--force"],
    ]


def _run(arguments: list[str]) -> _Step:
    """One command, by name; a finding or missing evidence does not end the chain."""
    from seamlog.cli import invoke

    start = time.monotonic()
    with spinner(f"seamlog {arguments[0]}"):
        try:
            outcome = invoke(arguments)
            note = outcome.ending.value if isinstance(outcome, Outcome) else ""
        except EvidenceError as error:
            note = f"no evidence: {error}"
    return _Step(arguments[0], time.monotonic() - start, note)


def _compare(session_path: Path, results: Results) -> tuple[bool, str]:
    """Set the join's first cause beside the truth that the virtual cell wrote down."""
    from seamlog.session import open_session

    with open_session(session_path) as session:
        truth = json.loads(session.metadata["seamlog.truth"]["json"])
    planted: Mapping[str, Any] = truth["planted_cause"]
    join = next((part for part in results.parts() if part.part == "join"), None)
    if join is None:
        raise SeamlogError(f"{results.folder} has no part 'join'; the demo's chain is broken")
    causes = _causes(join)
    found = any(_is_planted(cause, planted) for cause in causes)
    where = f"{planted['channel']} at {planted['s_mm']:.0f} mm"
    if found:
        return True, f"The planted cause ({where}) was found."
    named = ", ".join(f"{cause.get('channel')} at {cause.get('s_mm')} mm" for cause in causes)
    return False, f"The planted cause ({where}) was NOT found; the join names: {named or 'none'}."


def _causes(join: Part) -> list[dict[str, Any]]:
    causes = join.details.get("causes", [])
    return [cause for cause in causes if isinstance(cause, dict)]


def _is_planted(cause: Mapping[str, Any], planted: Mapping[str, Any]) -> bool:
    near = abs(float(cause.get("s_mm", "nan")) - float(planted["s_mm"])) <= PLACE_TOLERANCE_MM
    return near and cause.get("channel") == planted["channel"]
