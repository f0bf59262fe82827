"""Every public name of softstart has its place in the reference: one that is missing fails the build."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx
from sphinx.util import logging

import softstart

logger = logging.getLogger(__name__)


def check(app: Sphinx, env: Any) -> None:
    """A warning for each name of `softstart.__all__` without an entry."""
    known = env.domains["py"].objects
    for name in softstart.__all__:
        if f"softstart.{name}" not in known:
            logger.warning("softstart.%s is public, but no page in docs/reference describes it", name)


def setup(app: Sphinx) -> dict[str, Any]:
    """Connects the check."""
    app.connect("env-check-consistency", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
