"""Figures of one report, numbered, with ids of their own."""

from __future__ import annotations

from typing import Any

from softstart.reporting.markup import Html, Part
from softstart.reporting.svg import framed, inlined


class Figures:
    """Numbers the figures of a report in the order in which they are asked for."""

    def __init__(self) -> None:
        self.count = 0

    def prefix(self) -> str:
        """What the ids of the next figure begin with."""
        self.count += 1
        return f"figure-{self.count}"

    def drawn(self, figure: Any, title: str, caption: Part) -> Html:
        """A figure of matplotlib with its caption; `title` says for those who cannot see it what it shows."""
        prefix = self.prefix()
        return framed(inlined(figure, prefix, title), caption or "", self.count)

    def ready(self, picture: Html, caption: Part) -> Html:
        """A picture that was made with the last prefix, with its caption."""
        return framed(picture, caption or "", self.count)
