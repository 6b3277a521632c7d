"""No accessibility fault that axe-core can find, in light, in dark and without script."""

from pathlib import Path
from typing import Any

import pytest

from seamlog.cli import run
from seamlog.results import Results
from tests.browsing import Visitor

RUN = """async () => (await axe.run(document, {
    runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"],
})).violations.map(v => [v.id, v.help, v.nodes.map(n => n.html.slice(0, 200)).slice(0, 3)])"""


@pytest.fixture(scope="module")
def compare_page(sample: Results, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("compare") / "compare.html"
    assert run(["compare", str(sample.folder), str(sample.folder), "-o", str(path)]) == 0
    return path


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_fault_in_a_comparison(
    visitor: Visitor, compare_page: Path, node_modules: Path, scheme: Any
) -> None:
    script = (node_modules / "axe-core" / "axe.min.js").read_text()
    page = visitor.open(compare_page, color_scheme=scheme, bypass_csp=True).page
    page.evaluate(script)
    assert page.evaluate(RUN) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_no_fault(
    visitor: Visitor, sample_page: Path, node_modules: Path, scheme: Any, width: int
) -> None:
    script = (node_modules / "axe-core" / "axe.min.js").read_text()
    size = {"width": width, "height": 800}
    # The page's policy lets no foreign script in; for axe it is set aside.
    page = visitor.open(sample_page, color_scheme=scheme, viewport=size, bypass_csp=True).page
    page.evaluate(script)
    assert page.evaluate(RUN) == []
