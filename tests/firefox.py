"""Stock Firefox without a driver of its own: WebDriver BiDi over its own socket, on loopback."""

import json
import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

_LISTENS = re.compile(r"WebDriver BiDi listening on (ws://\S+)")
_PREFERENCES = {
    "app.normandy.enabled": "false",
    "app.update.enabled": "false",
    "browser.safebrowsing.malware.enabled": "false",
    "browser.safebrowsing.phishing.enabled": "false",
    "browser.shell.checkDefaultBrowser": "false",
    "datareporting.policy.dataSubmissionEnabled": "false",
    "extensions.systemAddon.update.enabled": "false",
    "network.captive-portal-service.enabled": "false",
    "network.connectivity-service.enabled": "false",
    "services.settings.server": '"data:,"',
    "toolkit.telemetry.enabled": "false",
}
_LONGEST_S = 60


@dataclass
class Firefox:
    """One tab; `events` collects requests and log entries of it."""

    socket: ClientConnection
    context: str = ""
    sent: int = 0
    events: list[dict[str, Any]] = field(default_factory=list)

    def ask(self, method: str, **params: Any) -> Any:
        """Send a command and wait for its answer; events that come first are kept."""
        self.sent += 1
        self.socket.send(json.dumps({"id": self.sent, "method": method, "params": params}))
        while True:
            message = json.loads(self.socket.recv(timeout=_LONGEST_S))
            if message.get("id") != self.sent:
                self.events.append(message)
            elif message["type"] == "error":
                raise RuntimeError(f"{method}: {message['error']}: {message['message']}")
            else:
                return message["result"]

    def open(self, path: Path) -> None:
        """Load a file and watch what it does."""
        self.context = self.ask("browsingContext.getTree")["contexts"][0]["context"]
        self.ask("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        where = path.as_uri()
        self.ask("browsingContext.navigate", context=self.context, url=where, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression, promises awaited; JSON types only."""
        wrapped = f"Promise.resolve({expression}).then(JSON.stringify)"
        target = {"context": self.context}
        done = self.ask("script.evaluate", expression=wrapped, target=target, awaitPromise=True)
        if done["type"] != "success":
            raise RuntimeError(done["exceptionDetails"]["text"])
        return json.loads(done["result"].get("value", "null"))

    def complaints(self) -> list[str]:
        """Texts of console entries and script errors."""
        return [e["params"]["text"] for e in self.events if e["method"] == "log.entryAdded"]

    def requests(self) -> list[str]:
        """Addresses of the requests of the page."""
        sent = (e["params"] for e in self.events if e["method"] == "network.beforeRequestSent")
        return [params["request"]["url"] for params in sent]


@contextmanager
def firefox(binary: str, profile: Path) -> Iterator[Firefox]:
    """Start Firefox with a fresh profile; it ends with the block."""
    lines = [f'user_pref("{name}", {value});' for name, value in _PREFERENCES.items()]
    (profile / "user.js").write_text("\n".join(lines))
    command = [binary, "--headless", "--no-remote", "--profile", str(profile)]
    command += ["--remote-debugging-port", "0", "about:blank"]
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"HOME": str(profile)},
    )
    try:
        with connect(f"{_address(process)}/session", max_size=None, proxy=None) as socket:
            page = Firefox(socket)
            page.ask("session.new", capabilities={})
            yield page
    finally:
        process.kill()
        process.communicate()


def _address(process: "subprocess.Popen[str]") -> str:
    assert process.stderr is not None
    told = []
    for line in process.stderr:
        if found := _LISTENS.search(line):
            return found[1]
        told.append(line)
    raise RuntimeError(f"Firefox ended without listening: {''.join(told)[-500:]}")
