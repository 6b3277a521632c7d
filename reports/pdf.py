"""A report as PDF, printed by a Chromium that is there: all plots as their drawings."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from seamlog.errors import HardwareError
from seamlog.files import replacing

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
_OPTIONS = (
    "--headless",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-pdf-header-footer",
)
_LONGEST_S = 300


def print_pdf(html: Path, pdf: Path, force: bool = False) -> None:
    """Print the report `html` into `pdf`, whole or not at all.

    Raises `HardwareError` where there is no Chromium or it prints nothing.
    """
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        raise HardwareError(
            "no Chromium on the PATH to print the PDF with; install one (Debian: apt install "
            f"chromium), or open {html} in any browser and print it there"
        )
    # As root Chromium does not start with its sandbox; the page is our own file.
    sandbox = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with replacing(pdf, force) as partial, tempfile.TemporaryDirectory() as profile:
        command = [browser, *_OPTIONS, *sandbox, f"--user-data-dir={profile}"]
        command += [f"--print-to-pdf={partial.resolve()}", html.resolve().as_uri()]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_LONGEST_S, check=False
        )
        if not partial.is_file() or not partial.stat().st_size:
            told = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
            raise HardwareError(f"{browser} printed no PDF of {html}: {told[0]}")
