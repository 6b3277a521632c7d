"""A real browser that watches what a report does."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page

ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@dataclass
class Visit:
    """An open page and everything it did that a report must not do."""

    page: Page
    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)


class Visitor:
    """Opens report files in a browser; `options` are those of a playwright context."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser

    def open(self, path: Path, **options: Any) -> Visit:
        options = {"viewport": {"width": 1280, "height": 800}} | options
        visit = Visit(self._browser.new_context(**options).new_page())
        page = visit.page
        page.on("request", lambda request: visit.requests.append(request.url))
        page.on("console", lambda message: visit.complaints.append(message.text))
        page.on("pageerror", lambda error: visit.complaints.append(str(error)))
        page.on("dialog", lambda dialog: visit.complaints.append(dialog.message))
        page.goto(path.as_uri())
        if options.get("java_script_enabled", True):
            page.wait_for_selector("html[data-state]", state="attached")
        return visit

    def close(self) -> None:
        for context in self._browser.contexts:
            context.close()
