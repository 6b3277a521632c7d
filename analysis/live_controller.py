"""What the session says about the controller that was live."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from seamlog.contracts import Axis
from seamlog.errors import SessionError

RECORD = "seamlog.controller"


@dataclass(frozen=True)
class LiveController:
    """Name, configuration and nominal axis of the live controller."""

    name: str
    config: dict[str, Any]
    axis: Axis


def live_controller(metadata: Mapping[str, Mapping[str, str]], where: str) -> LiveController | None:
    """Read the metadata record `seamlog.controller`; None if the session has none.

    Raises `SessionError` if it is there and cannot be understood.
    """
    record = metadata.get(RECORD)
    if record is None:
        return None
    try:
        config, axis = json.loads(record["config"]), json.loads(record["axis"])
        known = {item.name for item in fields(Axis)}
        unlimited = {"saturation": float("inf")} if axis.get("saturation") is None else {}
        values = {key: value for key, value in axis.items() if key in known}
        return LiveController(record["name"], dict(config), Axis(**(values | unlimited)))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SessionError(
            f"{where}: metadata record {RECORD!r} is not as docs/format.md says ({error!r}); "
            "it holds name, and config and axis as JSON"
        ) from error
