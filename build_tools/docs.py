"""Fill the generated parts of docs/: what a module prints goes into the page or the schema.

A page holds `<!-- generated: seamlog.channels -->` and `<!-- end -->`; what stands between is
replaced by the output of `python -m seamlog.channels`. `docs/schema/` holds the JSON Schemas. With
--check nothing is written and a file that is out of date ends in exit code 1.
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
PART = re.compile(r"(<!-- generated: (seamlog\.[a-z_.]+) -->\n).*?(<!-- end -->)", re.DOTALL)


SCHEMAS = {
    "report.schema.json": "seamlog.reports.document",
    "results-part.schema.json": "seamlog.results",
}
"""Files of docs/schema/ and the modules that print them."""


def printed(module: str) -> str:
    """What `python -m module` prints."""
    words = [sys.executable, "-m", module]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def filled(page: str) -> str:
    """`page` with each generated part anew."""
    return PART.sub(lambda part: f"{part[1]}{printed(part[2])}\n{part[3]}", page)


def fresh_files() -> Iterator[tuple[Path, str]]:
    """Every page and schema with the text it should have."""
    for path in sorted(DOCS.rglob("*.md")):
        yield path, filled(path.read_text(encoding="utf-8"))
    for name, module in SCHEMAS.items():
        yield DOCS / "schema" / name, printed(module) + "\n"


def main() -> int:
    """Write the pages, or with --check name those that are out of date."""
    stale = []
    for path, fresh in fresh_files():
        if path.is_file() and fresh == path.read_text(encoding="utf-8"):
            continue
        stale.append(path)
        if "--check" not in sys.argv:
            path.parent.mkdir(exist_ok=True)
            path.write_text(fresh, encoding="utf-8")
    for path in stale:
        print(f"{'out of date' if '--check' in sys.argv else 'written'}: {path}")
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
