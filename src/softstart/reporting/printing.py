"""A report as PDF: printed by a browser without a window, as it is laid out for paper."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from softstart.errors import InputError, Sentence

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge"),
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "C:/Program Files/Google/Chrome/Application/chrome.exe",
    "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe",
)
PRINTING = 120.0  # s for a browser to print a report


def browser_that_prints() -> str:
    """The browser of SOFTSTART_CHROMIUM, or one that is installed; InputError where there is none."""
    named = os.environ.get("SOFTSTART_CHROMIUM")
    browser = next(filter(None, map(shutil.which, [named] if named else BROWSERS)), None)
    if browser is None:
        what = f'SOFTSTART_CHROMIUM = "{named}": there is no such program' if named else "PDF: no browser"
        install = "Install Chromium, Chrome or Edge (Debian: apt-get install chromium), name it in"
        advice = f"{install} SOFTSTART_CHROMIUM, or print the file of --out in any browser."
        here = "Save the report as HTML, and print that file in your browser."
        raise InputError([Sentence(f"{what} to print with.", advice, here)])
    return named or browser


def printed(page: str, browser: str) -> bytes:
    """The page as PDF, printed by the browser without a window."""
    with tempfile.TemporaryDirectory(prefix="softstart-print-", ignore_cleanup_errors=True) as folder:
        source, target = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        words = [browser, "--headless", "--disable-gpu", "--no-pdf-header-footer"]
        # a profile of its own: a browser that runs already would take over and print nothing
        words += [f"--user-data-dir={folder}/profile", f"--print-to-pdf={target}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            words.append("--no-sandbox")  # which root cannot have
        try:
            command = [*words, source.as_uri()]
            done = subprocess.run(command, capture_output=True, timeout=PRINTING, check=False)
            said = " ".join(done.stderr.decode(errors="replace").split()[-20:])
            why = said or f"exit code {done.returncode}"
        except (OSError, subprocess.TimeoutExpired) as error:
            why = str(error)
        if not target.exists():
            fact, advice = f"PDF: {browser} did not print ({why}).", "Print the HTML file of --out instead."
            raise InputError([Sentence(fact, advice, "Save the report as HTML, and print that file.")])
        return target.read_bytes()
