"""What a sweep has computed so far, beside its results, so that it can go on where it stopped.

One Parquet file per session, `sweep.<key>.parquet`: the key is made of the session's SHA-256, of
what else the figures depend on and of the version, so that nothing stale is taken up again.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seamlog.errors import ResultsError
from seamlog.files import replacing

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Judged:
    """Figures of one point in one session, mm: one per member; NaN where the loop ran away."""

    rms_mm: Floats
    peak_mm: Floats
    warnings: tuple[str, ...]

    def of(self, kind: str) -> Floats:
        """The figures of one kind."""
        return self.rms_mm if kind == "rms" else self.peak_mm


def resume_key(session_sha256: Sequence[str], what: dict[str, Any]) -> str:
    """Sixteen hexadecimal digits."""
    from seamlog import __version__

    text = json.dumps([list(session_sha256), what, __version__], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Store:
    """Points by key; `save` rewrites the file as a whole and renames it."""

    def __init__(self, folder: Path, key: str) -> None:
        self.path = folder / f"sweep.{key}.parquet"
        self.judged: dict[str, Judged] = _load(self.path) if self.path.exists() else {}

    def save(self) -> None:
        """Write all points."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        found, texts = list(self.judged.values()), pa.list_(pa.string())
        table = pa.table(
            {
                "point": list(self.judged),
                "rms_mm": [judged.rms_mm for judged in found],
                "peak_mm": [judged.peak_mm for judged in found],
                "warnings": pa.array([list(judged.warnings) for judged in found], texts),
            }
        )
        with replacing(self.path) as partial:
            pq.write_table(table, partial, compression="zstd")


def _load(path: Path) -> dict[str, Judged]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        rows = pq.read_table(path).to_pylist()
    except (pa.ArrowException, OSError) as error:
        raise ResultsError(
            f"{path} cannot be read ({error}); remove it, and the sweep computes it anew"
        ) from error
    return {
        row["point"]: Judged(
            np.array(row["rms_mm"]), np.array(row["peak_mm"]), tuple(row["warnings"])
        )
        for row in rows
    }
