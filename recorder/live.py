"""Shows a recording live in Foxglove: `python -m seamlog.recorder.live SESSION HOST PORT`.

A process of its own, of low priority, that reads the session's growing file: the recording does
not know of it and cannot be held up by it. A viewer that does not keep up misses messages; what is
recorded does not. It ends when its standard input does.
"""

import logging
import os
import select
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from seamlog.contracts import Pace, Sink, Source, SourceResult
from seamlog.errors import SourceMissing, UsageError

from .live_tail import LiveTail
from .sources.drivers import FOXGLOVE

DEFAULT_PORT = 8765
_LOOK_MS = 40
_BACKLOG = 512
"""Messages kept per viewer; then its oldest are dropped."""
_log = logging.getLogger("seamlog.recorder")


def parse_address(text: str) -> tuple[str, int]:
    """`PORT` or `HOST:PORT`; loopback unless a host is given."""
    host, _, port = text.rpartition(":")
    if not port.isdigit() or not 0 < int(port) < 65_536:
        raise UsageError(f"--live {text!r}: write it as PORT or HOST:PORT")
    return host.strip("[]") or "127.0.0.1", int(port)


class ShownLive:
    """A source whose recording is shown while it runs; made as any other source is used."""

    def __init__(self, source: Source, path: Path, address: str) -> None:
        self._source, self._path = source, path
        self._host, self._port = parse_address(address)
        self.pace: Pace = source.pace
        self.clock = source.clock
        FOXGLOVE.load()
        _check_free(self._host, self._port)

    def run(self, sink: Sink) -> SourceResult:
        """Run the source beside the server."""
        place = (str(self._path.absolute()), self._host, str(self._port))
        command = [sys.executable, "-P", "-m", "seamlog.recorder.live", *place]
        server = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
        _log.info("live at ws://%s:%d", self._host, self._port)
        try:
            return self._source.run(sink)
        finally:
            server.terminate()
            with suppress(subprocess.TimeoutExpired):
                server.wait(1.0)
            server.kill()
            server.wait()
            if server.stdin is not None:
                server.stdin.close()


def _check_free(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            raise SourceMissing(
                f"--live: port {port} of {host} cannot be used ({error.strerror}); give another"
            ) from error


def main(arguments: list[str]) -> None:
    """Serve until standard input ends."""
    os.nice(10)
    foxglove = FOXGLOVE.load()
    path, host, port = Path(arguments[0]), arguments[1], int(arguments[2])
    server = foxglove.start_server(
        name=path.name, host=host, port=port, message_backlog_size=_BACKLOG
    )
    tail, channels = LiveTail(path), dict[str, Any]()
    while not select.select([sys.stdin], [], [], _LOOK_MS / 1000)[0]:
        for message in tail.messages():
            channel = channels.get(message.channel.topic)
            if channel is None:
                channel = channels[message.channel.topic] = _channel(foxglove, message)
            channel.log(bytes(message.payload), log_time=message.log_time_ns)
    server.stop()


def _channel(foxglove: Any, message: Any) -> Any:
    schema = message.schema
    return foxglove.Channel(
        message.channel.topic,
        message_encoding=message.channel.message_encoding,
        schema=schema
        and foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data),
        metadata=dict(message.channel.metadata),
    )


if __name__ == "__main__":
    main(sys.argv[1:])
