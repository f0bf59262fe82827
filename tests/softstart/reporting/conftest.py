"""One report of the crane drive, made once, and a reader of pages."""

from __future__ import annotations

import re
from collections import Counter
from html.parser import HTMLParser

import pytest

from softstart import Drive
from softstart.reporting import Report, report

HOSTILE = (
    """</title></style><script>alert(1)</script><img src=http://x.example/a onerror=a()> "'&\\}{{ 7 * 7 }}"""
)
COMMAND = "softstart report '<b>.toml' --out report.html"
STEPS = "torque=0.5%,time=10ms,speed=2rpm,share=5%"
VOID = frozenset({"meta", "br", "img"})


class Page(HTMLParser):
    """Elements, ids, attributes, tables and text of a page; every element is closed by its own name."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements, self.ids, self.attributes = Counter(), [], []
        self.tables, self.parts, self.inside = [], [], []
        self.feed(page.replace("\N{NO-BREAK SPACE}", " ").replace("K<sub>dyn</sub>", "K_dyn"))
        assert self.inside == []
        self.text = " ".join("".join(self.parts).split())

    def handle_startendtag(self, name, attributes):
        self._seen(name, attributes)

    def handle_starttag(self, name, attributes):
        self._seen(name, attributes)
        if name not in VOID:
            self.inside.append(name)
        if name == "table":
            self.tables.append([])
        if name == "tr":
            self.tables[-1].append([])
        if name in ("th", "td"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, name):
        assert self.inside.pop() == name

    def handle_data(self, data):
        self.parts.append(data)
        if {"th", "td"} & set(self.inside[-2:]):
            self.tables[-1][-1][-1] += data

    def _seen(self, name, attributes):
        self.elements[name] += 1
        self.ids += [value for key, value in attributes if key == "id"]
        self.attributes += [(name, key, value or "") for key, value in attributes]

    def rows(self, heading):
        """The rows of the table whose heading has this column, by their first cell."""
        for table in self.tables:
            if heading in table[0]:
                return {row[0]: dict(zip(table[0], row, strict=True)) for row in table[1:]}
        raise AssertionError(heading)


def verbatim(page: str) -> list[str]:
    """The files in a page, as they stand there."""
    return re.findall(r'<pre class="file">(.*?)</pre>', page, re.DOTALL)


@pytest.fixture(scope="session")
def hostile() -> Report:
    """A report whose every text from outside tries to break out; all strategies but the costly ones."""
    drive = Drive.load("crane-4amtkf").replace(name=HOSTILE, source=HOSTILE)
    names = ["direct", "ramp", "s-curve", "shaped", "reduced-first-stage"]
    return report(drive, controllers=names, resolution=STEPS, budget=0.0, command=COMMAND)


@pytest.fixture(scope="session")
def page(hostile: Report) -> str:
    return hostile.to_html()


@pytest.fixture(scope="session")
def read(page: str) -> Page:
    return Page(page)
