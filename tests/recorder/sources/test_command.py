"""`seamlog sources`: what can be recorded from, and what is missing for it."""

import json
import sys

import pytest

from seamlog.cli import run

NEEDS = {"serial": "serial", "modbus": "pymodbus", "genicam": "harvesters", "listen": "zmq"}
"""Source and the module of its driver."""


def test_all_sources_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sources", "list", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["sources"]}
    assert {"camera", "video", "virtual-cell", *NEEDS} <= set(rows)
    assert rows["video"]["pace"] == "simulated"
    assert all(row["available"] for row in rows.values())


@pytest.mark.parametrize("name", sorted(NEEDS))
def test_a_missing_driver_is_named(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, NEEDS[name], None)
    assert run(["sources", "list", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["sources"]}
    assert not rows[name]["available"]
    assert "pip install 'seamlog[" in rows[name]["missing"]
    assert run(["sources", "probe", name]) == 4
    assert "is not installed: pip install" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "code"), [("video", 2), ("none", 2)])
def test_what_cannot_be_probed(name: str, code: int) -> None:
    assert run(["sources", "probe", name]) == code
