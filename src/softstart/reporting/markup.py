"""HTML from small functions: text is escaped, only what they made themselves is not. Figures become SVG."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from softstart.late import late
from softstart.views.drawing import drawing
from softstart.views.numbers import Table

if TYPE_CHECKING:
    import matplotlib as mpl
else:
    mpl = late("matplotlib")

VOID = frozenset({"meta", "br", "hr", "col", "img"})
Part = str | None


class Html(str):
    """Text that is HTML already. Plain `str` never is."""

    __slots__ = ()


def html(*parts: Part) -> Html:
    """Parts one after the other; text among them is escaped, None left out.

    >>> html("a < b", tag("b", "&"))
    'a &lt; b<b>&amp;</b>'
    """
    return Html("".join(one if isinstance(one, Html) else escape(one) for one in parts if one is not None))


def tag(name: str, /, *parts: Part, **attributes: str | None) -> Html:
    """An element; `class_` and `aria_label` stand for class and aria-label, None leaves an attribute out.

    >>> tag("p", "1 < 2", class_='x"y')
    '<p class="x&quot;y">1 &lt; 2</p>'
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in VOID:
        return Html(f"<{name}{written}>")
    return Html(f"<{name}{written}>{html(*parts)}</{name}>")


def joined(parts: Iterable[Part], between: str = "\n") -> Html:
    """Parts with a separator between them."""
    return Html(html(between).join(html(one) for one in parts if one is not None))


def table(
    headings: Sequence[Part],
    rows: Sequence[Sequence[Part]],
    *,
    caption: str,
    text_columns: Sequence[int] = (0,),
    strong: Sequence[int] = (),
    class_: str | None = None,
) -> Html:
    """A table whose first column heads its rows; all but `text_columns` are set as numbers."""
    kinds = ["text" if index in text_columns else "number" for index in range(len(headings))]
    head = [tag("th", one, scope="col", class_=kind) for one, kind in zip(headings, kinds, strict=True)]
    body = []
    for number, row in enumerate(rows):
        first, *others = (html(one) for one in row)
        cells = [tag("th", first, scope="row", class_=kinds[0])]
        cells += [tag("td", one, class_=kind) for one, kind in zip(others, kinds[1:], strict=True)]
        body.append(tag("tr", *cells, class_="strong" if number in strong else None))
    whole = tag(
        "table",
        tag("caption", caption),
        tag("thead", tag("tr", *head)),
        tag("tbody", joined(body)),
        class_=class_,
    )
    return tag("div", whole, class_="wide")


def printed(one: Table, strong: Sequence[int] = (), caption: str = "") -> Html:
    """A table of the terminal as one of the page; its headings are said in the language of the page."""
    texts = [index for index, column in enumerate(one.columns) if not column.number]
    headings = [column.heading.replace("-\n", "- ").replace("\n", " ") for column in one.columns]
    return table(headings, one.rows, caption=caption or one.title, text_columns=texts, strong=strong)


def css_string(text: str) -> str:
    """Any text as a string of CSS that ends nowhere but at its end.

    >>> css_string('a"</style>')
    '"a\\\\22 \\\\3c \\\\2f style\\\\3e "'
    """
    return (
        '"'
        + "".join(c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in text)
        + '"'
    )


class Figures:
    """Numbers the figures of one report in their order, and keeps pictures that were drawn beforehand."""

    def __init__(self, drawn: Mapping[str, Html] | None = None) -> None:
        self.count = 0
        self.ready = dict(drawn or {})

    def shown(self, key: str, picture: Callable[[], Html], caption: Part) -> Html:
        """The picture of this key, made now unless it was drawn before, with number and caption."""
        self.count += 1
        if key not in self.ready:
            self.ready[key] = picture()
        number = tag("b", f"Figure {self.count}.", " ")
        return tag("figure", self.ready[key], tag("figcaption", number, caption))


def inlined(figure: Any, key: str, title: str) -> Html:
    """The figure as an <svg> element whose ids begin with `key`; its letters are those of the page.

    The same figure gives the same text. Screen readers read `title` instead of it.
    """
    buffer = io.StringIO()
    with drawing(), mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": key}):
        figure.savefig(
            buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
    whole = buffer.getvalue()
    box = re.search(r'viewBox="([^"]+)"', whole)
    assert box is not None
    inner = whole[whole.index(">", whole.index("<svg")) + 1 : whole.rindex("</svg>")]
    # a <style> would hold for the whole page; comments repeat every text
    inner = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", "", inner, flags=re.DOTALL)
    inner = re.sub(r'\bid="([^"]+)"', rf'id="{key}-\1"', inner)
    inner = re.sub(r'(?:xlink:)?href="#([^"]+)"', rf'href="#{key}-\1"', inner)
    inner = re.sub(r"url\(#([^)]+)\)", rf"url(#{key}-\1)", inner)
    inner = re.sub(r"font-family: [^;\"]*(; )?", "", inner)
    inner = re.sub(r"\s*\n\s*", "\n", inner)
    head = tag("title", title, id=f"{key}-title")
    return Html(
        f'<svg class="plot" viewBox="{box[1]}" role="img" aria-labelledby="{key}-title">{head}{inner}</svg>'
    )


_AS_IT_IS = re.compile(r"(<(pre|code|style|title|svg)\b.*?</\2>|<[^>]*>)", re.DOTALL)
_UNIT = r"(?:N\xa0m|kg\xa0m|ms|s|rad|deg|rpm|mm|Hz|kW|W|%)(?![\w])"
_TYPESET = (
    (re.compile(r"\b(N|kg) m(?=\b|²)"), "\\1\xa0m"),
    (re.compile(rf"(?<=\d) (?={_UNIT})"), "\xa0"),
    (re.compile(rf", (?={_UNIT}[^\w]*$)"), ",\xa0"),  # the unit of a heading
    (re.compile(r"\bK_dyn\b"), "K<sub>dyn</sub>"),
)


def typeset(page: str) -> str:
    """A page in whose text no line ends between a number and its unit, and indices are set as such.

    >>> typeset("<th>torque, N m</th><code>1 s</code><p>K_dyn 0.98 in 1 s</p>").replace("\xa0", "~")
    '<th>torque,~N~m</th><code>1 s</code><p>K<sub>dyn</sub> 0.98 in 1~s</p>'
    """
    return _in_texts(page, _AS_IT_IS, _TYPESET)


def _in_texts(page: str, skipped: re.Pattern[str], changes: Sequence[tuple[re.Pattern[str], str]]) -> str:
    """A page with these replacements in its texts; elements that are skipped stay as they are."""
    parts = skipped.split(page)  # text, what is skipped, name of its element, text, ...
    texts = parts[::3]
    for found, by in changes:
        texts = [found.sub(by, text) for text in texts]
    return "".join(text + other for text, other in zip(texts, [*parts[1::3], ""], strict=True))


_SKIPPED = re.compile(r"(<(pre|code|style|title)\b.*?</\2>|<[^>]*>)", re.DOTALL)
_DECIMAL = re.compile(r"(?<![\w.])(\d+)\.(\d+)(?![\w]|\.\d)")


def with_comma(page: str) -> str:
    """A page with decimal commas in its text; commands, files and version numbers stay as they are.

    >>> with_comma("<p>0.981 in 1.5 s, softstart 0.1.0</p><code>04.005</code>")
    '<p>0,981 in 1,5 s, softstart 0.1.0</p><code>04.005</code>'
    """
    return _in_texts(page, _SKIPPED, [(_DECIMAL, r"\1,\2")])
