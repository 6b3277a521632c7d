"""Run a command in a copy of this tree without its source folders.

`python build_tools/run_apart.py PYTHON -m pytest ...`: what the tests import can then only be what
is installed. The copy holds the files that git knows and the new ones it does not ignore.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = {"seamlog", "recorder", "analysis", "reports"}


def copy_tree(target: Path) -> None:
    """Copy everything but the source folders to `target`; npm's tools are linked."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in listed.stdout.splitlines():
        if Path(name).parts[0] in SOURCES or not (ROOT / name).is_file():
            continue
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target / name)
    (target / "node_modules").symlink_to(ROOT / "node_modules")


def main() -> int:
    """Run the words of the command line there; gives back their exit code."""
    data = os.environ.get("SEAMLOG_DATA") or ROOT.parent / "shared" / "data"
    environment = {**os.environ, "SEAMLOG_DATA": str(Path(data).resolve())}
    program = str((Path.cwd() / sys.argv[1]).absolute())
    with tempfile.TemporaryDirectory(prefix="seamlog-apart-") as scratch:
        copy_tree(Path(scratch))
        words = [program, *sys.argv[2:]]
        return subprocess.run(words, cwd=scratch, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
