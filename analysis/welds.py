"""Which welds of a session an analysis is about."""

from typing import TYPE_CHECKING

from seamlog.errors import UnknownName

if TYPE_CHECKING:
    from seamlog.session import Session
    from seamlog.welds import Weld


def chosen_welds(session: "Session", number: int | None) -> list["Weld"]:
    """The weld of this number, or all; `UnknownName` if there is no such weld."""
    welds = session.welds
    if number is None:
        return welds
    found = [weld for weld in welds if weld.number == number]
    if not found:
        raise UnknownName(f"{session.path} has no weld {number}; it has {len(welds)}")
    return found
