"""Configuration: files, overrides, and all faults at once."""

from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict, Field

from seamlog.config import load_config
from seamlog.errors import ConfigError, InputError


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    window_mm: float = Field(2.0, gt=0)


class Bead(BaseModel):
    model_config = ConfigDict(extra="forbid")
    station_mm: float = Field(0.25, gt=0, le=5)
    toe: str = "outer"
    inner: Inner = Inner()


def write(folder: Path, text: str, name: str = "seamlog.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_file_and_setting(tmp_path: Path) -> None:
    path = write(tmp_path, "[bead]\nstation_mm = 1.0\n[other]\nx = 1\n")
    config = load_config(Bead, "bead", path, ["bead.inner.window_mm=3", "bead.toe=metal"])
    assert (config.station_mm, config.inner.window_mm, config.toe) == (1.0, 3.0, "metal")


def test_pyproject_has_its_own_table(tmp_path: Path) -> None:
    path = write(tmp_path, "[tool.seamlog.bead]\ntoe = 'metal'\n", "pyproject.toml")
    assert load_config(Bead, "bead", path).toe == "metal"


def test_default_file_of_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path, "[bead]\ntoe = 'metal'\n")
    monkeypatch.chdir(tmp_path)
    assert load_config(Bead, "bead").toe == "metal"


def test_all_faults_at_once_with_path_and_nearest_key(tmp_path: Path) -> None:
    path = write(tmp_path, "[bead]\nstation_mm = -1\nto = 'x'\n[bead.inner]\nwindow_m = 'wide'\n")
    with pytest.raises(ConfigError) as caught:
        load_config(Bead, "bead", path)
    faults = "\n".join(caught.value.faults)
    assert len(caught.value.faults) == 3
    assert "bead.station_mm: input should be greater than 0" in faults
    assert "bead.to: no such key; did you mean toe?" in faults
    assert "bead.inner.window_m: no such key; did you mean window_mm?" in faults
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("setting", ["bead", "=1", "bead..x=1", "bead.toe.deep=1"])
def test_settings_that_make_no_sense(tmp_path: Path, setting: str) -> None:
    path = write(tmp_path, "[bead]\ntoe = 'outer'\n")
    with pytest.raises(ConfigError, match="--set"):
        load_config(Bead, "bead", path, [setting])


def test_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such configuration"):
        load_config(Bead, "bead", tmp_path / "absent.toml")
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_config(Bead, "bead", write(tmp_path, "[bead\n"))
