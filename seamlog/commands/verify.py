"""`seamlog verify`: is a report true to its results, and do its inputs give its figures again?"""

import json
import math
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import click

from seamlog.called import OUTPUT, RESULTS, filled
from seamlog.command import command
from seamlog.errors import EvidenceError, InputError, SeamlogError
from seamlog.outcome import Ending, Outcome
from seamlog.results import Criterion, Figure, Part, Results, input_of, report_id

RELATIVE = 1e-6
"""How far a recomputed figure may be off: other processors add in another order."""
_ABSOLUTE = 1e-9
_TWIN = re.compile(r'<script type="application/json" id="seamlog-report">(.*?)</script>', re.DOTALL)
_MOST_TOLD = 20
_ANALYSES = ("analyze", "bead", "identify", "replay", "sweep")
_WRITING = ("-o", "--output", "--results")


@dataclass
class _Findings:
    """What was found: counts of what agrees, sentences of what does not or cannot be told."""

    shown: int = 0
    recomputed: int = 0
    differences: list[str] = field(default_factory=list)
    untold: list[str] = field(default_factory=list)


@command()
@click.argument("report", type=click.Path(path_type=Path))
@click.argument("results_and_inputs", type=click.Path(path_type=Path), nargs=-1, required=True)
def verify(report: Path, results_and_inputs: tuple[Path, ...]) -> Outcome:
    """Set REPORT (its HTML or JSON) beside its results, and recompute them from their inputs.

    RESULTS_AND_INPUTS: the results directories of the report, in its order, and the files that
    they were made from, which are known by their SHA-256 whatever they are called now.
    """
    twin = _twin(report)
    folders = [path for path in results_and_inputs if path.is_dir()]
    files = [path for path in results_and_inputs if not path.is_dir()]
    opened = [Results.open(folder) for folder in folders]
    if not opened:
        raise InputError("no results directory was given; name those that the report was made of")
    found = _Findings()
    _check_id(twin, opened, found)
    _check_shown(twin, [part for results in opened for part in results.parts()], found)
    given = {input_of(path).sha256: path for path in files}
    for results in opened:
        _recompute(results, given, found)
    return _outcome(report, twin, found)


def _twin(report: Path) -> dict[str, Any]:
    text = report.read_text(encoding="utf-8", errors="replace")
    embedded = _TWIN.search(text)
    try:
        twin = json.loads(embedded[1] if embedded else text)
    except ValueError as error:
        raise InputError(f"{report} is no report of seamlog, neither as HTML nor JSON") from error
    if not isinstance(twin, dict) or twin.get("schema") != "seamlog.report":
        raise InputError(f"{report} is no report of seamlog (its schema is not seamlog.report)")
    return twin


def _check_id(twin: dict[str, Any], opened: Sequence[Results], found: _Findings) -> None:
    here = report_id(results.fingerprint() for results in opened)
    if twin.get("id") != here:
        found.differences.append(
            f"the report is of results with id {twin.get('id')}, these have {here}: other results, "
            "another order, or changed since"
        )


def _check_shown(twin: dict[str, Any], parts: Sequence[Part], found: _Findings) -> None:
    """Each figure and limit that the report shows stands in the results, digit by digit."""
    known = {_key(item) for part in parts for item in part.figures}
    known |= {_key(item) for part in parts for item in part.criteria}
    for item in _shown(twin):
        if _key(item) in known:
            found.shown += 1
        else:
            found.differences.append(f"shown and not in the results: {item.label} = {item.value}")


def _key(item: Figure | Criterion) -> str:
    return item.model_dump_json()


def _shown(twin: dict[str, Any]) -> Iterator[Figure | Criterion]:
    blocks = (block for section in twin.get("sections", []) for block in section.get("blocks", []))
    for block in blocks:
        if block.get("kind") in ("figures", "key_figures"):
            yield from (Figure.model_validate(each) for each in block["figures"])
        elif block.get("kind") == "criteria":
            yield from (Criterion.model_validate(each) for each in block["criteria"])


def _recompute(results: Results, given: dict[str, Path], found: _Findings) -> None:
    """Run each command that made parts of `results` again, in a folder of its own."""
    commands: dict[tuple[str, ...], list[Part]] = {}
    for part in results.parts():
        commands.setdefault(tuple(part.command), []).append(part)
    for words, parts in commands.items():
        missing = {i.name: i for part in parts for i in part.inputs if i.sha256 not in given}
        if missing:
            names = ", ".join(f"{i.name} (SHA-256 {i.sha256[:12]}...)" for i in missing.values())
            found.untold.append(f"{_stems(parts)}: not recomputed, input not given: {names}")
        elif not words:
            found.untold.append(f"{_stems(parts)}: not recomputed, not made by a command")
        elif not _is_harmless(words, {entry.name for part in parts for entry in part.inputs}):
            told = " ".join(words)
            found.untold.append(f"{_stems(parts)}: not recomputed, 'seamlog {told}' may do harm")
        else:
            _run_again(words, parts, given, found)


def _is_harmless(words: Sequence[str], inputs: set[str]) -> bool:
    """Results come from anywhere: only analyses run, write where we say, and read what was given.

    A word that is a file here and no input (a controller of one's own, a path) would be run unseen.
    """
    writes = [after for word, after in pairwise(words) if word in _WRITING]
    placed = all(word.startswith((RESULTS, OUTPUT)) for word in writes)
    values = {word.rpartition("=")[2].partition(":")[0] for word in words} | set(words)
    strange = any(value and Path(value).exists() for value in values - inputs)
    joined = any(word.startswith(_WRITING) and word not in _WRITING for word in words)
    return words[0] in _ANALYSES and placed and not joined and not strange


def _run_again(
    words: Sequence[str], parts: Sequence[Part], given: dict[str, Path], found: _Findings
) -> None:
    from seamlog.cli import invoke

    paths = {i.name: str(given[i.sha256]) for part in parts for i in part.inputs}
    with tempfile.TemporaryDirectory() as folder:
        fresh = Path(folder) / "results"
        arguments = filled(
            [paths.get(word, word) for word in words], fresh, Path(folder) / "output"
        )
        try:
            invoke(arguments)
            again = {part.stem: part for part in Results.open(fresh).parts()}
        except EvidenceError:
            again = (
                {part.stem: part for part in Results.open(fresh).parts()} if fresh.is_dir() else {}
            )
        except (SeamlogError, click.ClickException, OSError) as error:
            found.untold.append(f"{_stems(parts)}: 'seamlog {' '.join(words)}' fails here: {error}")
            return
    for part in parts:
        if part.stem in again:
            _compare(part, again[part.stem], found)
        else:
            found.differences.append(f"{part.stem}: the same command makes no such part now")


def _compare(part: Part, again: Part, found: _Findings) -> None:
    if part.verdict is not again.verdict:
        found.differences.append(f"{part.stem}: verdict {part.verdict}, now {again.verdict}")
    for kind, old, new in (
        ("figure", part.figures, again.figures),
        ("limit", part.criteria, again.criteria),
    ):
        fresh: dict[str, Figure | Criterion] = {item.name: item for item in new}
        for item in old:
            other = fresh.get(item.name)
            if other is not None and _alike(item.value, other.value) and _alike(item.u, other.u):
                found.recomputed += 1
            else:
                now = "missing" if other is None else other.value
                found.differences.append(
                    f"{part.stem}: {kind} {item.name} was {item.value}, is now {now}"
                )


def _alike(first: Any, second: Any) -> bool:
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=RELATIVE, abs_tol=_ABSOLUTE)
    return bool(first == second)


def _stems(parts: Sequence[Part]) -> str:
    return ", ".join(part.stem for part in parts)


def _outcome(report: Path, twin: dict[str, Any], found: _Findings) -> Outcome:
    lines = [
        f"{report}: report {twin.get('id')}, made by seamlog {twin.get('seamlog_version')}",
        f"  {found.shown} figures and limits shown stand in the results",
        f"  {found.recomputed} figures and limits came out again from the inputs",
    ]
    lines += [f"  DIFFERS: {text}" for text in found.differences[:_MOST_TOLD]]
    if len(found.differences) > _MOST_TOLD:
        lines.append(f"  and {len(found.differences) - _MOST_TOLD} differences more (--json)")
    lines += [f"  {text}" for text in found.untold]
    ending = Ending.PASS
    if found.differences:
        ending = Ending.FINDING
    elif found.untold or not found.recomputed:
        ending = Ending.NO_EVIDENCE
    return Outcome("seamlog.verify", "\n".join(lines), vars(found), ending)
