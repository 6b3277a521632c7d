"""Bad input at the command line: one clear message, the right code, nothing half-written."""

import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from seamlog import cli
from seamlog.mcap.batch import BatchWriter

MISSING, EMPTY, FOREIGN, CUT_HEAD = "missing.mcap", "empty.mcap", "foreign.mcap", "cut.mcap"
BROKEN = [MISSING, EMPTY, FOREIGN, CUT_HEAD]
READERS = [
    ["info", "{file}"],
    ["attach", "{file}", "photo.png"],
    ["identify", "{file}", "-o", "out"],
    ["replay", "{file}", "--controller", "pd", "-o", "out.mcap"],
    ["import", "{file}", "-o", "out.mcap"],
    ["export", "{file}", "-o", "out.mat"],
    ["compact", "{file}", "-o", "out.mcap"],
    ["bead", "measure", "--session", "{file}", "-o", "out"],
    ["analyze", "{file}", "-o", "out"],
    ["report", "{file}", "-o", "out.html"],
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    stamps = np.arange(100) * 40_000_000 + 1_767_225_600_000_000_000
    columns = {"stamp_ns": stamps, "position_m": np.zeros(100), "velocity_m_s": np.zeros(100)}
    with BatchWriter(tmp_path / "good.mcap") as writer:
        writer.write("/table/encoder", columns)
    (tmp_path / EMPTY).write_bytes(b"")
    (tmp_path / FOREIGN).write_bytes(b"time,position\n1,2\n" * 50)
    (tmp_path / CUT_HEAD).write_bytes((tmp_path / "good.mcap").read_bytes()[:20])
    (tmp_path / "map.toml").write_text("[time]\ncolumn = 't'\n")
    noise = np.random.default_rng(1).integers(0, 255, (200, 300), np.uint8)
    assert cv2.imwrite(str(tmp_path / "photo.png"), noise)
    monkeypatch.chdir(tmp_path)
    before = {path.name for path in tmp_path.iterdir()}
    yield tmp_path
    assert {path.name for path in tmp_path.iterdir()} - before == set(), "something half-written"


def complaint(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = cli.run(arguments)
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    return code, captured.err


@pytest.mark.parametrize("name", BROKEN)
@pytest.mark.parametrize("words", READERS, ids=lambda words: words[0])
def test_unreadable_inputs_end_with_code_3(
    name: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    code, message = complaint([word.format(file=name) for word in words], capsys)
    assert code == 3
    assert name in message
    assert message.startswith("seamlog: ")


@pytest.mark.parametrize("content", [None, b"", b"time,position\n1,2\n"])
def test_foreign_logs_that_are_none_end_with_code_3(
    folder: Path,
    tmp_path_factory: pytest.TempPathFactory,
    content: bytes | None,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tmp_path_factory.mktemp("log") / "log.mat"
    if content is not None:
        log.write_bytes(content)
    words = ["import", str(log), "--map", "map.toml", "-o", "out.mcap"]
    code, message = complaint(words, capsys)
    assert code == 3 and "log.mat" in message


def test_a_log_that_no_importer_knows_lists_the_importers(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["import", "photo.png", "--map", "map.toml", "-o", "out.mcap"]
    code, message = complaint(words, capsys)
    assert code == 2 and "mat" in message and "csv" in message


@pytest.mark.parametrize(
    "words",
    [
        ["identify", "good.mcap"],
        ["replay", "good.mcap", "--controller", "pd", "-o", "out.mcap"],
    ],
    ids=lambda words: words[0],
)
def test_a_missing_channel_is_named(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    code, message = complaint(words, capsys)
    assert code == 3
    assert "/table/command" in message


def test_unknown_names_list_the_known(capsys: pytest.CaptureFixture[str]) -> None:
    code, message = complaint(["record", "--source", "virtual-cel", "-o", "out.mcap"], capsys)
    assert code == 2 and "virtual-cell" in message


def test_a_configuration_with_three_faults_names_all(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["--set", "source.seed=no", "--set", "source.sed=1", "--set", "source.speeed=2"]
    words = ["record", "--source", "virtual-cell", "-o", "out.mcap", *settings, "--json"]
    assert cli.run(words) == 2
    captured = capsys.readouterr()
    message = json.loads(captured.out)["message"]
    assert all(key in message for key in ("source.seed", "source.sed", "source.speeed"))


def test_an_existing_output_is_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    code, message = complaint(["record", "--source", "virtual-cell", "-o", "good.mcap"], capsys)
    assert code == 2 and "--force" in message


def test_a_photo_without_a_bead_gives_no_width(capsys: pytest.CaptureFixture[str]) -> None:
    code, message = complaint(["bead", "measure", "photo.png"], capsys)
    assert code == 3
    assert "photo.png" in message and " mm" not in message


def test_a_photo_that_is_none(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, message = complaint(["bead", "measure", FOREIGN], capsys)
    assert code == 3 and FOREIGN in message
