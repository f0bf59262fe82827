"""One report of the crane drive, made once."""

from __future__ import annotations

import pytest

from softstart import Drive
from softstart.reporting import Report, report

HOSTILE = """</title></style><script>alert(1)</script><img src=http://x.example/a onerror=a()> "'&\\}"""
COMMAND = "softstart report '<b>.toml' --out report.html"
STEPS = "torque=0.5%,time=10ms,speed=2rpm,share=5%"


def untypeset(page: str) -> str:
    """A page without what only the eye needs: indices, and spaces at which no line ends."""
    return page.replace("\N{NO-BREAK SPACE}", " ").replace("K<sub>dyn</sub>", "K_dyn")


@pytest.fixture(scope="session")
def hostile() -> Report:
    """A report whose every text from outside tries to break out; all strategies but the costly ones."""
    drive = Drive.load("crane-4amtkf").replace(name=HOSTILE, source=HOSTILE)
    names = ["direct", "ramp", "s-curve", "shaped", "reduced-first-stage"]
    return report(drive, controllers=names, resolution=STEPS, budget=0.0, command=COMMAND)


@pytest.fixture(scope="session")
def page(hostile: Report) -> str:
    return hostile.to_html()
