"""Loss of power: a small file system on a loop device that forgets what was not synced."""

import fcntl
import os
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

_SHUTDOWN = 0x8004587D
"""EXT4_IOC_SHUTDOWN and XFS_IOC_GOINGDOWN: _IOR('X', 125, uint32)."""
_NO_LOG_FLUSH = 2
_SIZES_MB = {"ext4": 64, "xfs": 320}


class Disk:
    """A file system of its own in an image file; skips where that is not allowed."""

    def __init__(self, folder: Path, kind: str) -> None:
        maker = shutil.which(f"mkfs.{kind}")
        if os.geteuid() != 0 or maker is None:
            pytest.skip(f"loss of power is tried on a loop device: needs root and mkfs.{kind}")
        self._image, self.path = folder / "disk.img", folder / "disk"
        with self._image.open("wb") as file:
            file.truncate(_SIZES_MB[kind] << 20)
        subprocess.run([maker, "-q", str(self._image)], check=True, capture_output=True)
        self.path.mkdir()
        if fault := self.mount():
            pytest.skip(f"no loop device can be mounted here: {fault}")

    def mount(self) -> str:
        """Mount it; returns why not."""
        command = ["mount", "-o", "loop", str(self._image), str(self.path)]
        done = subprocess.run(command, capture_output=True, text=True)
        return done.stderr.strip() if done.returncode else ""

    def cut_power(self) -> None:
        """From now on nothing reaches the disk, and what was not synced never did."""
        folder = os.open(self.path, os.O_RDONLY)
        try:
            fcntl.ioctl(folder, _SHUTDOWN, struct.pack("<I", _NO_LOG_FLUSH))
        finally:
            os.close(folder)

    def unmount(self) -> None:
        """Unmount it, whatever is still open there."""
        subprocess.run(["umount", "-l", str(self.path)], check=False, capture_output=True)

    def power_up(self) -> None:
        """Come back with what was synced."""
        subprocess.run(["umount", str(self.path)], check=True)
        assert self.mount() == ""
