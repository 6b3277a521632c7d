"""The check of the original as criteria of a part, one per channel field, and as words."""

from seamlog.results import Criterion, Finding, Place, Severity, Verdict

from .check_original import Difference, OriginalCheck

_LABEL = "recorded controller on recorded measurements"


def check_criteria(check: OriginalCheck) -> list[Criterion]:
    """One criterion per field compared; a single one where nothing could be compared."""
    if check.holds is None or not check.engaged:
        verdict = Verdict.NOT_ASSESSED if check.engaged else Verdict.FAIL
        return [
            Criterion(
                name="original",
                label=f"original reproduced: {_LABEL}",
                value=None,
                verdict=verdict,
                reason=check.reason,
            )
        ]
    return [_criterion(row) for row in check.differences]


def check_findings(check: OriginalCheck) -> list[Finding]:
    """Which fields differ, and what was left out."""
    found = []
    if check.excluded:
        told = f"{check.excluded} control periods were left out of the check: holes and after them"
        found.append(Finding(severity=Severity.INFO, message=told))
    if not check.engaged:
        found.append(Finding(severity=Severity.FAULT, message=f"check failed: {check.reason}"))
    for row in check.differences:
        if row.different:
            place = Place(time_ns=row.first_ns)
            found.append(Finding(severity=Severity.FAULT, message=_told(row), place=place))
    return found


def _criterion(row: Difference) -> Criterion:
    return Criterion(
        name=f"original {row.name}",
        label=f"largest difference of {row.name}, {_LABEL}",
        value=row.largest,
        unit=row.unit,
        upper=row.tolerance,
        verdict=Verdict.FAIL if row.different or not row.compared else Verdict.PASS,
        reason="" if row.compared else "nothing was recorded to compare with",
        place=Place(time_ns=row.first_ns) if row.first_ns is not None else None,
    )


def _told(row: Difference) -> str:
    return (
        f"{row.name} is not reproduced: {row.different} of {row.compared} values differ by more "
        f"than {row.tolerance:.3g} {row.unit}, by up to {row.largest:.3g} {row.unit}, first at log "
        f"time {row.first_ns} ns"
    )
