"""No accessibility fault that axe-core can find, in light, in dark and without script."""

from pathlib import Path
from typing import Any

import pytest

from tests.browsing import Visitor

RUN = """async () => (await axe.run(document, {
    runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"],
})).violations.map(v => [v.id, v.help, v.nodes.map(n => n.html.slice(0, 200)).slice(0, 3)])"""


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
