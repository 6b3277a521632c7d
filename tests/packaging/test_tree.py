"""What pyproject.toml lists by hand is what the tree holds."""

import importlib
import json
import re
from pathlib import Path
from typing import Any

import pytest

import seamlog
from seamlog.cli import COMMANDS
from seamlog.plugins import GROUPS

ROOMS = ("recorder", "analysis", "reports")


def test_packages_are_the_folders_with_an_init(tree: Path, settings: dict[str, Any]) -> None:
    core = {path.parent for path in (tree / "seamlog").glob("*/__init__.py")}
    folders = {tree / "seamlog", *(path for path in core if path.name not in ROOMS)}
    for room in ROOMS:
        folders |= {path.parent for path in (tree / room).rglob("__init__.py")}
    names = [".".join(folder.relative_to(tree).parts) for folder in folders]
    found = {name if name.startswith("seamlog") else f"seamlog.{name}" for name in names}
    assert set(settings["tool"]["setuptools"]["packages"]) == found


def test_every_module_lies_in_a_package(tree: Path) -> None:
    for room in ("seamlog", *ROOMS):
        for path in (tree / room).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), path


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_are_linked_into_the_package(tree: Path, room: str) -> None:
    link = tree / "seamlog" / room
    assert link.is_symlink()
    assert link.readlink() == Path("..") / room


def test_each_package_has_a_caption(tree: Path, settings: dict[str, Any]) -> None:
    for name in settings["tool"]["setuptools"]["packages"]:
        caption = (importlib.import_module(name).__doc__ or "").partition("\n")[0]
        assert re.fullmatch(r"[A-Z].{15,110}\.", caption), name


def test_commands_are_the_static_table(settings: dict[str, Any]) -> None:
    listed = settings["project"]["entry-points"]["seamlog.commands"]
    assert listed == {name: target for name, (target, _) in COMMANDS.items()}


def test_entry_point_groups_are_known(settings: dict[str, Any]) -> None:
    groups = set(settings["project"]["entry-points"])
    assert groups <= set(GROUPS)


def test_every_entry_point_loads(settings: dict[str, Any]) -> None:
    for group, entries in settings["project"]["entry-points"].items():
        for name, target in entries.items():
            module, _, attribute = target.partition(":")
            assert hasattr(importlib.import_module(module), attribute), f"{group}: {name}"


def test_version_is_one(project: Path, settings: dict[str, Any]) -> None:
    assert settings["project"]["version"] == seamlog.__version__
    assert "version" not in json.loads((project / "package.json").read_text(encoding="utf-8"))


def test_all_extras_but_the_one_with_gpl_codecs(settings: dict[str, Any]) -> None:
    extras = settings["project"]["optional-dependencies"]
    (everything,) = extras["all"]
    assert set(everything[len("seamlog[") : -1].split(",")) == set(extras) - {"all", "video"}


def test_public_names() -> None:
    assert set(seamlog.__all__) == {"Session", "__version__", "open_session"}
    assert all(hasattr(seamlog, name) for name in seamlog.__all__)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = seamlog.no_such_name
