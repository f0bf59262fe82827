"""Which pages of the documentation explain a module: their links end the docstrings of its public names.

The longest prefix of a module's name counts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the table is read by tests too, where Sphinx is not installed
    from sphinx.application import Sphinx

PAGES = {
    "softstart.balancing": ("paper-b", "theory/balancer"),
    "softstart.chain": ("theory/reduction", "reference/chain-file"),
    "softstart.chain.machines": ("howto/python-in-a-notebook",),
    "softstart.chain.periodic_torque": ("theory/balancer",),
    "softstart.chain.two_masses": ("theory/reduction", "howto/reduce-a-driveline"),
    "softstart.clutch": ("paper-c", "theory/clutch"),
    "softstart.controller": ("howto/add-a-controller", "controllers", "theory/feedback"),
    "softstart.drive": ("theory/stages", "theory/contact-laws"),
    "softstart.drive.data_sheet": ("howto/own-drive",),
    "softstart.drive.machine_table": ("howto/python-in-a-notebook",),
    "softstart.export": ("howto/put-it-on-a-plc", "howto/use-an-fmu"),
    "softstart.identification": ("identification",),
    "softstart.kernel.records": ("howto/add-a-controller", "theory/feedback"),
    "softstart.linear": ("linear-view",),
    "softstart.optimal": ("optimal-starts", "theory/optimum"),
    "softstart.profile": ("optimal-starts", "theory/optimum"),
    "softstart.project": ("howto/keep-a-project",),
    "softstart.reporting": ("howto/read-a-report",),
    "softstart.start": ("theory/stages", "theory/reduction", "theory/numerics"),
    "softstart.start.comparison": ("theory/stages", "controllers"),
    "softstart.start.fatigue": ("fatigue",),
    "softstart.sweeping": ("sweeps",),
    "softstart.tuning": ("tuning",),
    "softstart.vibration": ("theory/reduction",),
}


def pages_of(module: str) -> tuple[str, ...]:
    """The pages about a module.

    >>> pages_of("softstart.start.fatigue"), pages_of("softstart.start.status")[0]
    (('fatigue',), 'theory/stages')
    """
    while module and module not in PAGES:
        module = module.rpartition(".")[0]
    return PAGES.get(module, ())


def process(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Called by autodoc for each docstring."""
    if what in ("class", "function", "exception"):
        links = ", ".join(f":doc:`/{page}`" for page in pages_of(getattr(obj, "__module__", "")))
        lines += ["", f"Documentation: {links}", ""] if links else []


def setup(app: Sphinx) -> dict[str, Any]:
    """Connects the table, after the docstrings have been converted."""
    app.connect("autodoc-process-docstring", process, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
