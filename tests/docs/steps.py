"""What a page of the documentation tells its reader to do: files to write, commands to type, Python to run.

A line of a fenced `sh` block, or of an indented block, that begins with `softstart ` or `make ` is a command.
Comments on the lines before a block, as `<!-- exit 3 -->`, speak to this runner: CONTRIBUTING.md lists them.
A command whose own comment names a time of half a minute or more (`# all numbers, about 50 s`) is long, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

Kind = Literal["file", "command", "python"]

FENCE = re.compile(r"^(?P<marks>`{3,}|~{3,}|:{3,})(?P<language>[\w{}-]*)(?P<rest>.*)$")
COMMENT = re.compile(r"^\s*<!--\s*(.+?)\s*-->\s*$")
COMMAND = re.compile(r"^(softstart|make)( |$)")
TIME = re.compile(r"#.*?\b(\d+(?:\.\d+)?) (s|min|h)\b")
LONG = 30.0  # s
MARKS = ("file:", "exit ", "long:", "continued", "not run:")


@dataclass(frozen=True)
class Step:
    """One thing to do. `text` is command, code or content; `output` what the page shows after it."""

    kind: Kind
    text: str
    line: int
    name: str = ""
    exit_code: int = 0
    long: bool = False
    continued: bool = False
    output: str | None = None


@dataclass(frozen=True)
class Block:
    """A block of a page with the comments before it; `after`: nothing stands between it and the last."""

    language: str
    lines: tuple[str, ...]
    line: int
    comments: tuple[str, ...]
    after: bool


def blocks(text: str) -> Iterator[Block]:
    """The fenced and indented blocks of a page, in order."""
    lines = text.splitlines()
    comments: list[str] = []
    directives: list[str] = []  # the marks of those that are open
    after = False
    i = 0
    while i < len(lines):
        line = lines[i]
        fence = FENCE.match(line)
        comment = COMMENT.match(line)
        if comment:
            comments.append(comment[1])
            i += 1
        elif fence and fence["language"].startswith("{"):
            directives.append(fence["marks"])
            i += 1  # a directive: what stands in it is read like the page
        elif fence and directives and line.strip() == directives[-1]:
            directives.pop()
            comments, after, i = [], False, i + 1
        elif fence and fence["marks"][0] != ":":
            end = i + 1 + [*map(str.strip, lines[i + 1 :]), fence["marks"]].index(fence["marks"])
            yield Block(fence["language"], tuple(lines[i + 1 : end]), i + 2, tuple(comments), after)
            comments, after, i = [], True, end + 1
        elif line.startswith("    ") and (i == 0 or not lines[i - 1].strip() or COMMENT.match(lines[i - 1])):
            end = i
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            inner = tuple(one[4:] for one in lines[i:end])
            yield Block("indented", inner, i + 1, tuple(comments), after)
            comments, after, i = [], True, end
        else:
            if line.strip():
                comments, after = [], False
            i += 1


def steps(text: str) -> list[Step]:
    """What the page tells to do, in order."""
    found: list[Step] = []
    for block in blocks(text):
        marks = {mark: c[len(mark) :].strip() for c in block.comments for mark in MARKS if c.startswith(mark)}
        if "not run:" in marks:
            continue
        if "file:" in marks:
            content = "\n".join(block.lines).rstrip() + "\n"
            found.append(Step("file", content, block.line, marks["file:"]))
        elif block.language in ("sh", "bash", "console", "indented", ""):
            found += _commands(block, marks)
        elif block.language in ("python", "py", "pycon"):
            code, long = "\n".join(block.lines) + "\n", "long:" in marks
            found.append(Step("python", code, block.line, long=long, continued="continued" in marks))
        elif block.language == "text" and block.after and found and found[-1].kind != "file":
            found[-1] = replace(found[-1], output="\n".join(block.lines))
    return found


def _commands(block: Block, marks: dict[str, str]) -> list[Step]:
    """The commands of a block, lines that end with a backslash joined."""
    found: list[Step] = []
    lines = list(enumerate(block.lines, start=block.line))
    while lines:
        number, line = lines.pop(0)
        if not COMMAND.match(line):
            continue
        while line.endswith("\\") and lines:
            line = line[:-1] + lines.pop(0)[1].lstrip()
        found.append(Step("command", line.rstrip(), number, long="long:" in marks or _seconds(line) >= LONG))
    if found and "exit " in marks:
        found[-1] = replace(found[-1], exit_code=int(marks["exit "]))
    return found


def _seconds(line: str) -> float:
    """The time that the comment behind a command names.

    >>> _seconds("softstart study paper-c  # all numbers, 10 s"), _seconds("softstart study wear  # 4 min")
    (10.0, 240.0)
    """
    found = TIME.search(line)
    return float(found[1]) * {"s": 1.0, "min": 60.0, "h": 3600.0}[found[2]] if found else 0.0


def pages(root: Path) -> list[Path]:
    """All pages written by hand."""
    docs = root / "docs"
    hidden = {"_build", "gallery_pages", "gallery"}
    inner = [p for p in sorted(docs.rglob("*.md")) if not hidden & set(p.relative_to(docs).parts)]
    return [root / "README.md", root / "CONTRIBUTING.md", *inner]
