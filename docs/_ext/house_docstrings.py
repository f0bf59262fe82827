"""The docstrings of this house as reStructuredText: they are written for the reader of the code.

`name` in single backticks is a link where it is a public name of softstart, else code. Of the numpydoc
sections, *Parameters*, *Attributes*, *Returns* and *Raises* become fields, the others headings. Indented
lines after a blank one are equations, kept as they are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

import softstart

FIELDS = ("Parameters", "Attributes", "Returns", "Raises")
HEADINGS = ("Notes", "Examples", "References", "See Also", "Warnings")
ENTRY = re.compile(r"^(?P<names>\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: : (?P<text>.*))?$")
FORWARD = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")
CODE = re.compile(r"(`[^`]*`)")


def convert(lines: list[str]) -> list[str]:
    """The lines of a docstring as reStructuredText.

    >>> convert(["Parameters", "----------", "drive : a Drive,", "    or its name.", "", "Text."])
    [':Parameters:', '    - **drive**: a Drive,', '      or its name.', '', 'Text.']
    """
    return list(_safe(_indented(list(_sections(lines)))))


def _sections(lines: list[str]) -> Iterator[str]:
    """With fields in place of underlined parts."""
    part = ""
    left = iter(range(len(lines)))
    for i in left:
        line = lines[i]
        ahead = lines[i + 1].strip() if i + 1 < len(lines) else ""
        if re.fullmatch(r"-{3,}", ahead) and line.strip() in FIELDS + HEADINGS:
            heading = line.strip()
            part = heading if heading in FIELDS else ""
            yield from [f":{heading}:"] if part else [f".. rubric:: {heading}", ""]
            next(left)
            continue
        if not line.strip():
            part = ""
        entry = ENTRY.match(line) if part else None
        if entry and part != "Returns":
            names = entry["names"].replace("*", "")
            yield f"    - **{names}**" + (f": {entry['text']}" if entry["text"] else "")
        elif part == "Returns":
            typed = line[:1] != " " and lines[i + 1 : i + 2] and lines[i + 1][:1] == " "
            yield f"    {line.strip()}" + (":" if typed else "")
        elif part:
            yield f"      {line.strip()}"
        else:
            yield line


def _safe(lines: Iterable[str]) -> Iterator[str]:
    """With the bars of absolute values, which reStructuredText would take for its own, escaped in prose."""
    literal = session = False
    for line in lines:
        if line == "::":
            literal = True
        elif line[:1] not in ("", " "):
            literal = False
        session = line.lstrip().startswith(">>>") or (session and bool(line.strip()))
        if literal or session:
            yield line
        else:
            yield "".join(p if p.startswith("`") else p.replace("|", r"\|") for p in CODE.split(line))


def _indented(lines: list[str]) -> Iterator[str]:
    """With a mark before each indented block that is no list and no session."""
    inside = session = False
    for i, line in enumerate(lines):
        before = lines[i - 1] if i else ""
        if line.lstrip().startswith(">>>"):
            session = True
        elif not line.strip():
            session = False
        starts = bool(line[:1] == " " and not before.strip() and not session)
        if starts and not inside and _text_before(lines, i):
            yield "::"
            yield ""
            inside = True
        if line[:1] not in ("", " "):
            inside = False
        yield line


def _text_before(lines: list[str], i: int) -> bool:
    """Whether the paragraph before line i is plain text, so that the indent means something."""
    above = [line for line in lines[:i] if line.strip()]
    last = next((line for line in reversed(above) if line[:1] != " "), "")
    return bool(above) and not re.match(r"([-*] |\d+\. |:\w+|\.\. |>>>)", last)


def process(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Called by autodoc for each docstring."""
    lines[:] = convert(lines)


def named_types(
    app: Sphinx, what: str, name: str, obj: object, options: object, signature: Any, returns: Any
) -> Any:
    """Types that go by a name of their own under that name, also within a union."""
    texts = (signature, returns)
    return tuple(text and FORWARD.sub(r"\1", text) for text in texts)


def house_role(
    role: str, rawtext: str, text: str, lineno: int, inliner: Any, options: Any = None, content: Any = None
) -> tuple[list[nodes.Node], list[nodes.system_message]]:
    """Single backticks: a link to a public name, else code."""
    plain = text.replace("\x00", "\\")
    name = plain.removesuffix("()").removeprefix("softstart.")
    code = nodes.literal(rawtext, plain, classes=["code"])
    if name.split(".")[0] not in softstart.__all__ or name == "Run.summary":
        return [code], []
    link = addnodes.pending_xref(
        rawtext, nodes.literal(rawtext, plain, classes=["xref", "py"]), refdomain="py", reftype="obj",
        reftarget=f"softstart.{name}", refexplicit=True, refwarn=False,
    )  # fmt: skip
    return [link], []


def resolve(app: Sphinx, env: Any, node: addnodes.pending_xref, content: nodes.TextElement) -> Any:
    """Types in signatures: those of softstart are linked where they are public, others stay text."""
    if node.get("refdomain") != "py":
        return None
    target = str(node.get("reftarget", ""))
    last = target.rsplit(".", 1)[-1]
    domain = env.domains["py"]
    known = domain.objects.get(f"softstart.{last}") if last in softstart.__all__ else None
    if known is None:
        return content
    from sphinx.util.nodes import make_refnode

    return make_refnode(app.builder, node["refdoc"], known.docname, known.node_id, content, last)


def setup(app: Sphinx) -> dict[str, Any]:
    """Connects the three."""
    from docutils.parsers.rst import roles

    roles.register_local_role("house", house_role)
    app.connect("autodoc-process-docstring", process)
    app.connect("autodoc-process-signature", named_types)
    app.connect("missing-reference", resolve, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
