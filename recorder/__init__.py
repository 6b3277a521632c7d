"""The live side: control loop to ring to session file, recovery, sources and importers."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .accounts import Account, Status
    from .channel import Channel
    from .joining import JoinedProducer, join
    from .recorder import Recorder
    from .storage import Snapshot, Storage

__all__ = [
    "Account",
    "Channel",
    "JoinedProducer",
    "Recorder",
    "Snapshot",
    "Status",
    "Storage",
    "join",
]
_HOMES = {
    "Account": "accounts",
    "Channel": "channel",
    "JoinedProducer": "joining",
    "Recorder": "recorder",
    "Snapshot": "storage",
    "Status": "accounts",
    "Storage": "storage",
    "join": "joining",
}


def __getattr__(name: str) -> Any:
    """Load the recorder when it is first asked for, so that its commands import little."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
