"""Matplotlib's figures as SVG to be put into an HTML page, several of them, without clashes."""

from __future__ import annotations

import io
import re
from typing import Any

from softstart.reporting.markup import Html, html, tag
from softstart.views.drawing import drawing

_ID = re.compile(r'\bid="([^"]+)"')
_REFERENCE = re.compile(r'(?:xlink:)?href="#([^"]+)"')
_URL = re.compile(r"url\(#([^)]+)\)")


def inlined(figure: Any, prefix: str, title: str) -> Html:
    """The figure as an <svg> element whose ids begin with `prefix`; text is drawn as paths.

    The same figure gives the same text. `title` is read out in its place.
    """
    import matplotlib as mpl

    buffer = io.StringIO()
    with drawing(), mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": prefix}):
        figure.savefig(
            buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
    whole = buffer.getvalue()
    box = re.search(r'viewBox="([^"]+)"', whole)
    assert box is not None
    inner = whole[whole.index(">", whole.index("<svg")) + 1 : whole.rindex("</svg>")]
    inner = re.sub(r"<metadata>.*?</metadata>", "", inner, flags=re.DOTALL)
    inner = re.sub(r"<style.*?</style>", "", inner, flags=re.DOTALL)  # it would hold for the whole page
    inner = re.sub(r"<!--.*?-->", "", inner, flags=re.DOTALL)  # every text once more
    inner = _ID.sub(rf'id="{prefix}-\1"', inner)
    inner = _REFERENCE.sub(rf'href="#{prefix}-\1"', inner)
    inner = _URL.sub(rf"url(#{prefix}-\1)", inner)
    inner = re.sub(r"\s*\n\s*", "\n", inner)
    head = tag("title", title, id=f"{prefix}-title")
    return Html(
        f'<svg class="plot" viewBox="{box[1]}" role="img" aria-labelledby="{prefix}-title">'
        f"{head}{inner}</svg>"
    )


def framed(picture: Html, caption: str | Html, number: int) -> Html:
    """A figure with its caption."""
    said = tag("figcaption", tag("b", f"Figure {number}. "), html(caption))
    return tag("figure", picture, said)
