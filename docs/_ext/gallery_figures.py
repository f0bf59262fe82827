"""Figures of the gallery: those bound to names in a script's part, as SVG; their label is the caption.

The figures of this house live outside pyplot, so the usual scraper does not see them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from softstart.views.drawing import drawing

SEEN = "__seen_figures__"
FIRST = ("paper_g", "optimal", "pulse", "wear", "gaps", "paper_r", "paper_c", "paper_b")  # others follow


class Order:
    """Sort key of the gallery: the drive with a gap first, other machines and benchmarks after it."""

    def __init__(self, src_dir: str) -> None:
        self.src_dir = src_dir

    def __call__(self, filename: str) -> tuple[int, str]:
        """Place of a script among the others."""
        subject = filename.removeprefix("plot_")
        place = next((i for i, first in enumerate(FIRST) if subject.startswith(first)), len(FIRST))
        return place, filename

    def __repr__(self) -> str:
        """For sphinx's comparison of settings: without an address in memory."""
        return "<Order>"


def scraper(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save what is new in this part of the script; returns the reStructuredText that shows it."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    names = block_vars["example_globals"]
    seen: list[Figure] = names.setdefault(SEEN, [])
    shown = []
    paths = block_vars["image_path_iterator"]
    for value in list(names.values()):
        if not isinstance(value, Figure) or any(value is one for one in seen):
            continue
        seen.append(value)
        path = Path(next(paths)).with_suffix(".svg")
        with drawing(), mpl.rc_context({"svg.fonttype": "path"}):  # the fonts of the pages lack some signs
            value.savefig(path, format="svg", metadata={"Date": None}, facecolor="white")
        caption = " ".join(str(value.get_label()).split())
        place = "/" + path.relative_to(gallery_conf["src_dir"]).as_posix()
        head = f".. figure:: {place}\n    :alt: {caption or path.stem}\n    :class: sheet"
        shown.append(f"{head}\n\n    {caption}\n")
    return "\n".join(shown)
