"""Mathematics as MathML, written at build time by latex2mathml: it shows offline, without scripts."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

logger = logging.getLogger(__name__)

OPEN_ENDED = re.compile(r"\\tag\{[^}]*\}|\\label\{[^}]*\}")


def mathml(latex: str, display: str, place: nodes.Node) -> str:
    """The element <math>; what cannot be converted is a warning at its place."""
    try:
        return convert(latex.strip(), display=display)
    except Exception as error:  # the library raises a dozen kinds
        logger.warning("not convertible to MathML (%r): %s", error, latex, location=place)
        return f"<code>{nodes.Text(latex)}</code>"


def visit_math(translator: Any, node: nodes.math) -> None:
    """Within a line."""
    translator.body.append(f'<span class="math">{mathml(node.astext(), "inline", node)}</span>')
    raise nodes.SkipNode


def visit_math_block(translator: Any, node: nodes.math_block) -> None:
    """On lines of its own, with the number of the equation where it has a label."""
    latex = OPEN_ENDED.sub("", node.astext())
    if not re.search(r"\\begin\{(align|aligned|gather|cases|array|equation|multline)", latex) and (
        r"\\" in latex
    ):
        latex = rf"\begin{{aligned}}{latex}\end{{aligned}}"
    latex = re.sub(r"\\(begin|end)\{(equation|gather|multline)\*?\}", "", latex)
    translator.body.append(translator.starttag(node, "div", CLASS="math-block"))
    translator.body.append(mathml(latex, "block", node))
    if node.get("number"):
        number = get_node_equation_number(translator, node)
        translator.body.append(f'<span class="eqno">({number})')
        translator.add_permalink_ref(node, "Link to this equation")
        translator.body.append("</span>")
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the renderer; conf.py need not name it, it is the only one."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
