"""Build backend of seamlog: setuptools, and uPlot fetched before anything is packed."""

import shutil
from pathlib import Path
from typing import Any

import npm
import uplot
from setuptools import build_meta
from setuptools.build_meta import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

Settings = dict[str, Any] | None


def _node_if_missing() -> list[str]:
    return [] if npm.command() or uplot.is_present() else [npm.REQUIREMENT]


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Requirements of a wheel: Node.js only where npm and uPlot are missing."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_node_if_missing()]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """Requirements of an editable install: as those of a wheel."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *_node_if_missing()]


def build_wheel(
    wheel_directory: str,
    config_settings: Settings = None,
    metadata_directory: str | None = None,
) -> str:
    """Build the wheel with uPlot in it, and with nothing that an earlier build left behind."""
    uplot.ensure()
    shutil.rmtree(Path("build", "lib"), ignore_errors=True)
    return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(
    wheel_directory: str,
    config_settings: Settings = None,
    metadata_directory: str | None = None,
) -> str:
    """Build the editable wheel; uPlot goes into the tree, where git ignores it."""
    uplot.ensure()
    return build_meta.build_editable(wheel_directory, config_settings, metadata_directory)
