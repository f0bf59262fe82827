"""The page's own element: its script and its look, from the package. Imports NiceGUI only when used."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import new_class
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nicegui.element import Element

WEB = Path(__file__).with_name("web")


@cache
def instrument() -> type[Element]:
    """The element that draws everything live: `web/softstart_instrument.js`, over the modules beside it."""
    from nicegui.element import Element

    return new_class(
        "Instrument",
        (Element,),
        {"component": WEB / "softstart_instrument.js", "esm": {"softstart-page": str(WEB / "modules")}},
    )


def style() -> str:
    """The style sheets of the page, in order."""
    return "\n".join((WEB / name).read_text(encoding="utf-8") for name in ("style.css", "quasar.css"))
