"""Reference pages written from the program itself: a line `<!-- generated: WHAT -->` becomes Markdown."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import command_pages
import parameter_pages
from sphinx.application import Sphinx
from sphinx.util import logging

logger = logging.getLogger(__name__)

MARK = re.compile(r"^<!-- generated: ([\w-]+) -->$", re.MULTILINE)

ROOT = Path(__file__).parents[2]


def contributing() -> str:
    """CONTRIBUTING.md with its links as seen from here."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    text = re.sub(r"\]\(docs/", "](", text).replace("](CHANGELOG.md)", "](changelog.md)")
    return re.sub(r"\[([\w.]+)\]\((CITATION\.cff|README\.md)\)", r"`\1`", text)


WRITERS: dict[str, Callable[[], str]] = {
    "commands": command_pages.commands,
    "drive-file": parameter_pages.drive_file,
    "chain-file": parameter_pages.chain_file,
    "clutch-file": parameter_pages.clutch_file,
    "engine-file": parameter_pages.engine_file,
    "controllers": parameter_pages.controllers,
    "shipped": parameter_pages.shipped,
    "studies": parameter_pages.studies,
    "contributing": contributing,
}


def fill(app: Sphinx, docname: str, source: list[str]) -> None:
    """Replace each mark by its text."""

    def text(found: re.Match[str]) -> str:
        if found[1] not in WRITERS:
            logger.warning(
                "nothing is called %r; there are %s", found[1], ", ".join(WRITERS), location=docname
            )
            return ""
        app.env.note_reread()
        return WRITERS[found[1]]()

    source[0] = MARK.sub(text, source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Connects it."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
