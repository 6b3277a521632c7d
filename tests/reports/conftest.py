"""Sample results and the page made from them, once for all tests of reports."""

from pathlib import Path

import pytest

from seamlog.reports.report import Report
from seamlog.results import Results
from tests.reports.sample_results import write_sample


@pytest.fixture(scope="session")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return write_sample(tmp_path_factory.mktemp("sample") / "weld.results")


@pytest.fixture(scope="session")
def sample_page(sample: Results, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    report = Report()
    report.add_results(sample)
    report.write(path)
    return path
