"""Results: a directory with one `<part>.json` per part, tables as Parquet, pictures beside them.

Analysis writes it, reports read it and nothing else. Every part has the same shape (`Part`):
figures with uncertainty, criteria with a verdict, findings with a place, tables, pictures. What
could not be measured is there too, as a figure without value and with the reason.
`python -m seamlog.results` prints the JSON Schema of a part.
"""

import hashlib
import json
import sys
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from seamlog.called import call_to
from seamlog.errors import ResultsError
from seamlog.files import replacing, write_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Columns = Mapping[str, NDArray[Any]]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", populate_by_name=True, serialize_by_alias=True)


class Verdict(StrEnum):
    """How a criterion or part was judged; what was not assessed never counts as passed."""

    PASS = "PASS"
    FAIL = "FAIL"
    NOT_MEASURABLE = "NOT MEASURABLE"
    NOT_ASSESSED = "NOT ASSESSED"


class Severity(StrEnum):
    """Weight of a finding."""

    INFO = "info"
    WARNING = "warning"
    FAULT = "fault"


class Place(_Model):
    """Where: arc length along the bead, log time, weld number; each may be unknown."""

    s_mm: float | None = None
    time_ns: int | None = None
    weld: int | None = None


class Figure(_Model):
    """One number (or word) with its unit and standard uncertainty `u` in the same unit.

    `value` None means that it could not be known; `reason` then says why. With a value, `reason`
    may name weaker evidence behind it.
    """

    name: str
    label: str
    value: float | int | str | None
    unit: str = ""
    u: float | None = None
    reason: str = ""


class Criterion(_Model):
    """A limit that somebody gave, and how the value stands to it."""

    name: str
    label: str
    value: float | None
    unit: str = ""
    u: float | None = None
    lower: float | None = None
    upper: float | None = None
    verdict: Verdict
    reason: str = ""
    place: Place | None = None


class Finding(_Model):
    """Something a person should know, with the place it is at."""

    severity: Severity
    message: str
    place: Place | None = None


class TableFile(_Model):
    """A Parquet file beside the part; `columns` gives each column's unit (or '')."""

    file: str
    rows: int
    columns: dict[str, str]
    sha256: str


class Picture(_Model):
    """A picture file beside the part."""

    file: str
    caption: str
    width_px: int
    height_px: int
    sha256: str
    time_ns: int | None = None


class Input(_Model):
    """A file the part was made from."""

    name: str
    sha256: str
    bytes: int


class Part(_Model):
    """One part of the results, the same shape for every kind.

    `index` counts parts of one kind (several welds or photos). `details` holds what has no place
    in the uniform fields; keys and meaning are the part's own.
    """

    schema_: Literal["seamlog.results.part"] = Field("seamlog.results.part", alias="schema")
    version: int = 1
    part: str
    index: int = 1
    title: str
    weld: int | None = None
    seamlog_version: str = ""
    inputs: list[Input] = []
    command: list[str] = []
    """The call that made it, as `seamlog.called` writes it down; empty outside of a command."""
    configuration: dict[str, Any] = {}
    verdict: Verdict = Verdict.NOT_ASSESSED
    reason: str = ""
    figures: list[Figure] = []
    criteria: list[Criterion] = []
    findings: list[Finding] = []
    tables: dict[str, TableFile] = {}
    pictures: dict[str, Picture] = {}
    details: dict[str, Any] = {}

    @property
    def stem(self) -> str:
        """File name without suffix."""
        return self.part if self.index == 1 else f"{self.part}.{self.index}"

    def figure(self, name: str) -> Figure | None:
        """The figure called `name`, or None."""
        return next((figure for figure in self.figures if figure.name == name), None)


def input_of(path: Path) -> Input:
    """Name, SHA-256 and size of an input file."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return Input(name=path.name, sha256=digest, bytes=path.stat().st_size)


def worst(verdicts: list[Verdict]) -> Verdict:
    """FAIL before anything unknown before PASS; nothing to judge is NOT ASSESSED."""
    for verdict in (Verdict.FAIL, Verdict.NOT_ASSESSED, Verdict.NOT_MEASURABLE):
        if verdict in verdicts:
            return verdict
    return Verdict.PASS if verdicts else Verdict.NOT_ASSESSED


class Results:
    """A results directory.

    `Results.create` makes or reopens one for writing, `Results.open` reads one that is there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @classmethod
    def create(cls, folder: Path) -> "Results":
        """Make `folder` if it is not there; a folder of other content is refused."""
        if folder.exists() and not folder.is_dir():
            raise ResultsError(f"{folder} is a file; results need a folder of their own")
        folder.mkdir(parents=True, exist_ok=True)
        return cls(folder)

    @classmethod
    def open(cls, folder: Path) -> "Results":
        """Open for reading; `ResultsError` if it holds no part."""
        results = cls(folder)
        if not folder.is_dir() or not any(results._part_files()):
            raise ResultsError(
                f"{folder} holds no results; make some with 'seamlog analyze SESSION -o {folder}'"
            )
        return results

    def _part_files(self) -> "Iterator[Path]":
        return (path for path in sorted(self.folder.glob("*.json")) if path.is_file())

    def write(
        self,
        part: Part,
        tables: Mapping[str, tuple[Columns, Mapping[str, str]]] | None = None,
        pictures: Mapping[str, tuple[bytes, Picture]] | None = None,
    ) -> Part:
        """Write a part with its tables (columns, units) and pictures (bytes, description).

        The JSON is written last, so that a part that can be seen is whole. Returns the part with
        the files it now names.
        """
        from seamlog import __version__

        written = {
            name: self._write_table(part.stem, name, *table)
            for name, table in (tables or {}).items()
        }
        images = {}
        for name, (data, picture) in (pictures or {}).items():
            file = f"{part.stem}.{name}{Path(picture.file).suffix}"
            write_bytes(self.folder / file, data)
            digest = hashlib.sha256(data).hexdigest()
            images[name] = picture.model_copy(update={"file": file, "sha256": digest})
        whole = part.model_copy(
            update={
                "tables": written,
                "pictures": images,
                "seamlog_version": __version__,
                "command": part.command or call_to(self.folder),
            }
        )
        text = whole.model_dump_json(indent=1) + "\n"
        write_bytes(self.folder / f"{part.stem}.json", text.encode())
        return whole

    def _write_table(
        self, stem: str, name: str, columns: Columns, units: Mapping[str, str]
    ) -> TableFile:
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = pa.table({key: pa.array(np.asarray(column)) for key, column in columns.items()})
        path = self.folder / f"{stem}.{name}.parquet"
        with replacing(path) as partial:
            pq.write_table(table, partial, compression="zstd")
        digest = input_of(path).sha256
        named = {key: units.get(key, "") for key in columns}
        return TableFile(file=path.name, rows=table.num_rows, columns=named, sha256=digest)

    def parts(self) -> list[Part]:
        """All parts, by name and index."""
        found = (self._read(path) for path in self._part_files())
        return sorted(found, key=lambda part: (part.part, part.index))

    def _read(self, path: Path) -> Part:
        try:
            return Part.model_validate_json(path.read_bytes())
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(item) for item in first["loc"])
            raise ResultsError(
                f"{path} is no part of results: {where}: {first['msg']}; run analyze again"
            ) from error

    def columns(self, part: Part, name: str) -> dict[str, NDArray[Any]]:
        """A table of `part` as numpy arrays by column name."""
        import pyarrow.parquet as pq

        table = pq.read_table(self._member(part.tables[name].file))
        return {key: table[key].to_numpy(zero_copy_only=False) for key in table.column_names}

    def picture(self, part: Part, name: str) -> bytes:
        """The bytes of a picture of `part`."""
        return self._member(part.pictures[name].file).read_bytes()

    def fingerprint(self) -> bytes:
        """SHA-256 over all parts; `ResultsError` for files that were changed after the analysis."""
        digest = hashlib.sha256()
        for part in self.parts():
            digest.update(part.model_dump_json().encode())
            files = [(table.file, table.sha256) for table in part.tables.values()]
            files += [(picture.file, picture.sha256) for picture in part.pictures.values()]
            for name, sha256 in files:
                path = self._member(name)
                if hashlib.sha256(path.read_bytes()).hexdigest() != sha256:
                    raise ResultsError(f"{path} was changed after the analysis; run analyze again")
        return digest.digest()

    def _member(self, name: str) -> Path:
        if Path(name).name != name:
            raise ResultsError(
                f"{self.folder}: {name!r} is no plain file name; refuse to follow it"
            )
        return self.folder / name


def report_id(fingerprints: "Iterable[bytes]") -> str:
    """Id of a report on results with these fingerprints, in their order."""
    return hashlib.sha256(b"".join(fingerprints)).hexdigest()[:16]


def part_schema() -> dict[str, Any]:
    """JSON Schema of `<part>.json`."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return head | Part.model_json_schema()


if __name__ == "__main__":
    sys.stdout.write(json.dumps(part_schema(), indent=1) + "\n")
