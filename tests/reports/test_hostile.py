"""Text from outside stays text, wherever in the results it stands."""

import json
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from seamlog.reports.report import Report
from seamlog.results import Criterion, Figure, Finding, Input, Part, Results, Severity, Verdict
from tests.browsing import Visitor
from tests.reports.sample_results import write_sample

ALERTS = (
    "<script>alert(1)</script>",
    "</script><script>alert(1)</script>",
    "</title><script>alert(1)</script>",
    "</style><script>alert(1)</script>",
    "</textarea><script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "<svg onload=alert(1)>",
    "<svg><script>alert(1)</script></svg>",
    "<iframe src=javascript:alert(1)></iframe>",
    "<a href=javascript:alert(1)>x</a>",
    "<body onload=alert(1)>",
    "<input autofocus onfocus=alert(1)>",
    "<details open ontoggle=alert(1)>",
    "<video><source onerror=alert(1)></video>",
    "<math><mtext><img src=x onerror=alert(1)>",
    "<object data=javascript:alert(1)>",
    "<base href=https://example.invalid/>",
    "<link rel=stylesheet href=https://example.invalid/x.css>",
    "<meta http-equiv=refresh content=0;url=https://example.invalid/>",
    "<form action=https://example.invalid/><button>x</button></form>",
)
BREAKERS = (
    '"><img src=x onerror=alert(1)>',
    "'><img src=x onerror=alert(1)>",
    '" onmouseover="alert(1)" x="',
    "' onmouseover='alert(1)' x='",
    "` onmouseover=alert(1) x=`",
    '" style="position:fixed;inset:0" x="',
    "--><script>alert(1)</script>",
    "<!--",
    "<!--<script>",
    "]]><script>alert(1)</script>",
    "<![CDATA[<script>alert(1)</script>]]>",
    "javascript:alert(1)",
    "data:text/html,<script>alert(1)</script>",
    "{{ 7 * 7 }}",
    "{% raw %}",
    "{# comment",
    "${alert(1)}",
    "\\u003cscript\\u003ealert(1)\\u003c/script\\u003e",
    "&lt;script&gt;alert(1)&lt;/script&gt;",
    "&#60;script&#62;alert(1)",
)
ODDITIES = (
    "\u2028alert(1)\u2029",
    "line\nfeed\r\nand\ttab",
    "\u202eright to left",
    "\ufeffmark",
    "nul\x00byte",
    "\x1b[31mred\x1b[0m",
    "__proto__",
    "constructor",
    "𝕳𝖔𝖘𝖙𝖎𝖑𝖊 \U0001f4a5 \u0301\u0301\u0301",
    "x" * 3000,
)
CLOSERS = (
    "",
    '"',
    "'",
    "`",
    '">',
    "'>",
    "-->",
    "]]>",
    "</script>",
    "</style>",
    "</title>",
    "</textarea>",
    "</svg>",
    "</a>",
    "</noscript>",
    "</select></option>",
    "\\",
    "\\u0022>",
    "%22%3E",
    "&quot;>",
    "\r\n\r\n",
    "\x00",
    "\ufeff",
    "\u2028",
    "{{",
)
"""What ends the place that a text stands in; each before each alert."""
PAYLOADS = ALERTS + BREAKERS + ODDITIES
MANY = tuple(dict.fromkeys(PAYLOADS + tuple(f"{a}{b}" for a in CLOSERS for b in ALERTS)))
KEPT = {"schema", "file", "sha256", "verdict", "severity", "kind"}
"""Fields that are not free text: the model refuses other values."""

SKELETON = """() => {
    const walk = node => [node.tagName, ...node.getAttributeNames().sort(),
                          ...Array.from(node.children, walk)];
    return JSON.stringify(walk(document.documentElement));
}"""


def _replaced(value: Any, texts: "count[int]", payloads: tuple[str, ...], key: str = "") -> Any:
    if isinstance(value, dict):
        return {
            k: v if k == "columns" else _replaced(v, texts, payloads, k) for k, v in value.items()
        }
    if isinstance(value, list):
        return [_replaced(item, texts, payloads, key) for item in value]
    if isinstance(value, str) and key not in KEPT and (value or key == "reason"):
        return payloads[next(texts) % len(payloads)]
    return value


def _talkative(texts: tuple[str, ...]) -> Part:
    """A part with every text as message, label, unit, reason, limit and metadata."""
    figures = [
        Figure(name=f"f{i}", label=text, value=text if i % 2 else None, unit=text, reason=text)
        for i, text in enumerate(texts)
    ]
    criteria = [
        Criterion(name=f"c{i}", label=text, value=1.0, unit=text, verdict=Verdict.FAIL, reason=text)
        for i, text in enumerate(texts)
    ]
    findings = [Finding(severity=Severity.WARNING, message=text) for text in texts]
    return Part(
        part="talkative",
        title=texts[0],
        inputs=[Input(name=text, sha256="0" * 64, bytes=1) for text in texts],
        figures=figures,
        criteria=criteria,
        findings=findings,
        details={"metadata": {"part": texts[1], "wps": texts[2], "material": texts[3]}},
    )


def _write(folder: Path, payloads: tuple[str, ...], many: tuple[str, ...], first: int) -> Path:
    """A report whose results have a payload in each text field, also in column names."""
    results = write_sample(folder / "results")
    series = {f"{text} {i}": np.arange(5.0) for i, text in enumerate(payloads)}
    table = {"stamp_ns": np.arange(5) * 10**9} | series
    units = {name: str(i % 6) for i, name in enumerate(series)}
    results.write(Part(part="extra", title="extra"), tables={"odd": (table, units)})
    results.write(_talkative(many))
    texts = count(first)
    for path in sorted((folder / "results").glob("*.json")):
        part = json.loads(path.read_text())
        if part["part"] == "talkative":
            continue
        kind = part.pop("part")
        hostile = _replaced(part, texts, payloads)
        path.write_text(json.dumps(hostile | {"part": kind}))
    output = folder / "report.html"
    report = Report(title=payloads[first % len(payloads)])
    report.add_results(Results.open(folder / "results"))
    report.write(output)
    return output


@pytest.mark.parametrize("first", [0, 25])
def test_hostile_text_leaves_the_page_as_it_is(
    visitor: Visitor, tmp_path: Path, first: int
) -> None:
    harmless = tuple(f"text {i}" for i in range(len(PAYLOADS)))
    quiet = tuple(f"word {i}" for i in range(len(MANY)))
    (tmp_path / "harmless").mkdir()
    (tmp_path / "hostile").mkdir()
    expected = visitor.open(_write(tmp_path / "harmless", harmless, quiet, first))
    found = visitor.open(_write(tmp_path / "hostile", PAYLOADS, MANY, first))
    found.page.wait_for_timeout(100)
    assert found.page.evaluate(SKELETON) == expected.page.evaluate(SKELETON)
    assert found.complaints == []
    assert [url for url in found.requests if not url.startswith(("data:", "file:"))] == []
    assert found.page.locator("html").get_attribute("data-state") == "live"


def test_there_are_five_hundred() -> None:
    assert len(set(MANY)) >= 500
