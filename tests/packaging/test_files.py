"""What may stand in a committed file."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

HOSTS = (
    ("pypi", "org"),
    ("pythonhosted", "org"),
    ("npmjs", "org"),
    ("npmjs", "com"),
    ("npmmirror", "com"),
    ("yarnpkg", "com"),
    ("crates", "io"),
    ("rubygems", "org"),
    ("anaconda", "org"),
    ("golang", "org"),
)
FORBIDDEN = re.compile(
    "|".join(re.escape(".".join(host)) for host in HOSTS)
    + r"|--(?:extra-)?index-url +\S+:"
    + r"|(?<![\w.])/(?:work|root|opt/wheels)/\w"
)
LINE_LIMIT = 400


@pytest.fixture(scope="module")
def committed(tree: Path) -> list[Path]:
    if shutil.which("git") is None or not (tree / ".git").exists():
        pytest.skip("needs the git repository")
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=tree, capture_output=True, text=True, check=True
    )
    paths = [tree / name for name in listed.stdout.split("\0") if name]
    return [path for path in paths if path.is_file() and not path.is_symlink()]


def forbidden_in(path: Path) -> list[str]:
    return FORBIDDEN.findall(path.read_bytes().decode("utf-8", "replace"))


def test_no_file_names_a_registry_or_a_path_of_one_machine(committed: list[Path]) -> None:
    assert {str(path): found for path in committed if (found := forbidden_in(path))} == {}


@pytest.mark.parametrize(
    "line",
    ["https://" + ".".join(HOSTS[0]) + "/simple", "see /" + "work/shared", HOSTS[1][0] + ".org"],
)
def test_the_pattern_finds_what_it_is_for(line: str, tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(line, encoding="utf-8")
    assert forbidden_in(tmp_path / "page.md")


def test_source_files_stay_small(committed: list[Path]) -> None:
    sources = [path for path in committed if path.suffix in {".py", ".js", ".mjs", ".css"}]
    long = {
        str(path): lines
        for path in sources
        if (lines := path.read_bytes().count(b"\n")) > LINE_LIMIT
    }
    assert long == {}
