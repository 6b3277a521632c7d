"""Drivers of sources are optional packages: asked for when used, missing ones named."""

import importlib
import importlib.util
from dataclasses import dataclass
from types import ModuleType

from seamlog.errors import SourceMissing


@dataclass(frozen=True, slots=True)
class Driver:
    """A package that a source needs, and the extra of seamlog that brings it."""

    module: str
    package: str
    extra: str

    @property
    def is_installed(self) -> bool:
        """Whether it can be imported, without doing so."""
        return importlib.util.find_spec(self.module) is not None

    @property
    def advice(self) -> str:
        """What to do when it is missing."""
        return f"{self.package} is not installed: pip install 'seamlog[{self.extra}]'"

    def load(self, name: str = "") -> ModuleType:
        """The module, or the one `name` inside it; `SourceMissing` says what to install."""
        if not self.is_installed:
            raise SourceMissing(self.advice)
        return importlib.import_module(f"{self.module}.{name}" if name else self.module)


SERIAL = Driver("serial", "pyserial", "serial")
MODBUS = Driver("pymodbus", "pymodbus", "serial")
HARVESTERS = Driver("harvesters", "harvesters", "camera")
VIDEO = Driver("av", "av", "video")
ZEROMQ = Driver("zmq", "pyzmq", "live")
FOXGLOVE = Driver("foxglove", "foxglove-sdk", "live")
