"""The configurations in docs/howto are ones that the sources take."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from seamlog.recorder.sources.camera import CameraConfig
from seamlog.recorder.sources.genicam import GenicamConfig
from seamlog.recorder.sources.listen import ListenConfig
from seamlog.recorder.sources.modbus import ModbusConfig
from seamlog.recorder.sources.serial_line import SerialConfig

LINE = {"port": "/dev/ttyUSB0"}
CASES: list[tuple[str, int, Any, dict[str, Any]]] = [
    ("record-a-camera.md", 0, CameraConfig, {}),
    ("record-a-camera.md", 1, GenicamConfig, {}),
    ("record-an-encoder.md", 0, SerialConfig, {}),
    ("record-an-encoder.md", 1, SerialConfig, LINE),
    ("record-an-encoder.md", 2, ModbusConfig, {}),
    ("record-from-another-language.md", 0, ListenConfig, {}),
]


@pytest.mark.parametrize(("page", "place", "config", "more"), CASES)
def test_the_documented_configuration_is_valid(
    project: Path, page: str, place: int, config: Any, more: dict[str, Any]
) -> None:
    text = (project / "docs" / "howto" / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    config.model_validate(tomllib.loads(blocks[place])["source"] | more)
