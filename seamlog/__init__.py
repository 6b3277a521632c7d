"""Flight recorder and replay laboratory of robotic seam tracking: the core, the ground floor."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from seamlog.session import Session, open_session

__version__ = "0.1.0"
__all__ = ["Session", "__version__", "open_session"]


def __getattr__(name: str) -> Any:
    """Load the session reader when it is first asked for, so that `import seamlog` stays cheap."""
    if name in ("Session", "open_session"):
        from seamlog import session

        return getattr(session, name)
    raise AttributeError(f"module 'seamlog' has no attribute {name!r}")
