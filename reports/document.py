"""The whole report as typed content: what the page shows, and what its JSON twin is the dump of.

`python -m seamlog.reports.document` prints the JSON Schema of the twin.
"""

import json
import sys
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from seamlog.results import Verdict

from .content import Section
from .curves import Link


class Document(BaseModel):
    """Everything the page shows. Curves are named by keys of the page's data block."""

    model_config = ConfigDict(populate_by_name=True, serialize_by_alias=True)

    schema_: Literal["seamlog.report"] = Field("seamlog.report", alias="schema")
    version: int = 1
    title: str
    subject: str
    id: str
    date: str | None
    verdict: Verdict
    seamlog_version: str
    interactive: bool
    notes: list[str] = Field(default_factory=list)
    """What the file leaves out, and why: pictures thinned to a size, for example."""
    sections: list[Section]
    links: list[Link]

    def twin(self) -> dict[str, Any]:
        """The report for programs: the objects the page was made of, without the arrays."""
        return self.model_dump(mode="json")


def twin_schema() -> dict[str, Any]:
    """JSON Schema of the twin."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return head | Document.model_json_schema(mode="serialization")


if __name__ == "__main__":
    sys.stdout.write(json.dumps(twin_schema(), indent=1) + "\n")
