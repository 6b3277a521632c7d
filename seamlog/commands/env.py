"""`seamlog env`: what a bug report needs."""

import platform
from importlib.metadata import PackageNotFoundError, requires, version

from seamlog import __version__
from seamlog.command import command
from seamlog.outcome import Outcome


@command()
def env() -> Outcome:
    """Versions of seamlog, Python, the system and the libraries, for a bug report."""
    facts = {
        "seamlog": __version__,
        "python": platform.python_version(),
        "system": platform.platform(),
        "machine": platform.machine(),
    }
    libraries = {name: _version(name) for name in _required()}
    lines = [f"{name:<24} {value}" for name, value in (facts | libraries).items()]
    return Outcome("seamlog.env", "\n".join(lines), {"facts": facts, "libraries": libraries})


def _required() -> list[str]:
    listed = requires("seamlog") or []
    return [line.split()[0].split(">")[0] for line in listed if "extra ==" not in line]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"
