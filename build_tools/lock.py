"""Write the locks anew: exact versions with hashes, naming no index address.

Run through `make lock`, which brings uv; with ARGS=--upgrade versions move on.
"""

import subprocess
import sys
from pathlib import Path

import npm

ROOT = Path(__file__).resolve().parent.parent
LOCKS = {"dev.lock": ("build", "test", "lint"), "bench.lock": ("build", "bench")}
"""Each lock holds the dependencies of the project and those of these groups."""


def compile_lock(name: str, groups: tuple[str, ...], extra: list[str]) -> None:
    """Resolve pyproject.toml for every platform into requirements/`name`."""
    words = [str(Path(sys.executable).parent / "uv"), "pip", "compile", "--quiet", "--universal"]
    words += ["--python-version", "3.11", "--generate-hashes", "--no-emit-index-url"]
    words += ["--no-header", "--no-annotate", "pyproject.toml", "-o", f"requirements/{name}"]
    words += [word for group in groups for word in ("--group", group)]
    if name != "dev.lock":
        words += ["--constraint", "requirements/dev.lock"]
    subprocess.run([*words, *extra], cwd=ROOT, check=True)


def main() -> None:
    """Write both Python locks and the one of npm."""
    for name, groups in LOCKS.items():
        compile_lock(name, groups, sys.argv[1:])
    act = "update" if "--upgrade" in sys.argv else "install"
    done = npm.run([act, "--package-lock-only", "--omit-lockfile-registry-resolved"], ROOT)
    if done.returncode != 0:
        sys.exit(done.stderr)


if __name__ == "__main__":
    main()
