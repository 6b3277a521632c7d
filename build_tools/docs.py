"""Fill the generated parts of docs/: what a module of the core prints goes into the page.

A page holds `<!-- generated: seamlog.channels -->` and `<!-- end -->`; what stands between is
replaced by the output of `python -m seamlog.channels`. With --check nothing is written and a page
that is out of date ends in exit code 1.
"""

import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
PART = re.compile(r"(<!-- generated: (seamlog\.[a-z_.]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def printed(module: str) -> str:
    """What `python -m module` prints."""
    words = [sys.executable, "-m", module]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def filled(page: str) -> str:
    """`page` with each generated part anew."""
    return PART.sub(lambda part: f"{part[1]}{printed(part[2])}\n{part[3]}", page)


def main() -> int:
    """Write the pages, or with --check name those that are out of date."""
    stale = []
    for path in sorted(DOCS.rglob("*.md")):
        page = path.read_text(encoding="utf-8")
        fresh = filled(page)
        if fresh == page:
            continue
        stale.append(path)
        if "--check" not in sys.argv:
            path.write_text(fresh, encoding="utf-8")
    for path in stale:
        print(f"{'out of date' if '--check' in sys.argv else 'written'}: {path}")
    return 1 if stale and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
