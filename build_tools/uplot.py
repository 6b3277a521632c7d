"""Fetch the plotting script of the reports: one pinned npm package, checked by its hash.

As a script: `python build_tools/uplot.py` brings it into reports/assets/uplot/.
"""

import base64
import hashlib
import io
import os
import sys
import tarfile
import tempfile
from pathlib import Path

import npm

VERSION = "1.6.32"
INTEGRITY = "sha512-KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW1AHtpm6IKTXImkbLgkMy+jabjLgSLMasNuGGzQm/ep3tOkyTxpiQIw=="
FILES = {
    "package/dist/uPlot.iife.min.js": (
        "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f"
    ),
    "package/dist/uPlot.min.css": (
        "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04"
    ),
    "package/LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}
"""Members of the package that go with the reports, and the SHA-256 of each."""

FOLDER = Path(__file__).resolve().parent.parent / "reports" / "assets" / "uplot"


class IntegrityError(RuntimeError):
    """The package that came is not the one that is pinned."""


class Unreachable(RuntimeError):
    """The package could not be fetched: no network, or no npm."""


def is_present(folder: Path = FOLDER) -> bool:
    """Whether `folder` holds every file with the pinned content."""
    return all(
        (folder / Path(member).name).is_file()
        and hashlib.sha256((folder / Path(member).name).read_bytes()).hexdigest() == digest
        for member, digest in FILES.items()
    )


def fetch() -> bytes:
    """The package as npm hands it out; raises Unreachable."""
    with tempfile.TemporaryDirectory() as scratch:
        try:
            done = npm.run(
                ["pack", f"uplot@{VERSION}", "--fetch-retries=1", "--cache", f"{scratch}/cache"],
                Path(scratch),
            )
        except OSError as error:
            raise Unreachable(str(error)) from error
        packed = Path(scratch) / f"uplot-{VERSION}.tgz"
        if done.returncode != 0 or not packed.is_file():
            reason = (done.stderr.strip() or "it wrote no package").splitlines()[0]
            raise Unreachable(f"npm pack uplot@{VERSION}: {reason}")
        return packed.read_bytes()


def unpack(packed: bytes, folder: Path = FOLDER) -> None:
    """Check `packed` against the pinned hashes and write its files; raises IntegrityError."""
    digest = "sha512-" + base64.b64encode(hashlib.sha512(packed).digest()).decode()
    if digest != INTEGRITY:
        raise IntegrityError(f"uplot {VERSION} has the hash {digest}, expected {INTEGRITY}")
    folder.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        for member in FILES:
            content = archive.extractfile(member)
            if content is None:
                raise IntegrityError(f"uplot {VERSION} has no {member}")
            (folder / Path(member).name).write_bytes(content.read())


def ensure(folder: Path = FOLDER) -> bool:
    """Bring uPlot into `folder`; False with a warning where it cannot be fetched.

    A wrong hash fails always, a missing script only with SEAMLOG_RELEASE=1 in the environment.
    """
    if is_present(folder):
        return True
    try:
        unpack(fetch(), folder)
    except Unreachable as error:
        if os.environ.get("SEAMLOG_RELEASE") == "1":
            raise
        print(f"warning: reports will have static plots only: {error}", file=sys.stderr)
        return False
    return True


if __name__ == "__main__":
    ensure()
