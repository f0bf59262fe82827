"""Where the report comes from."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softstart.reporting.markup import Html, html, table, tag

if TYPE_CHECKING:
    from softstart.reporting.result import Report


def provenance_section(report: Report) -> Html:
    """Versions, date, command, and the drive's file with all changes."""
    about = report.provenance
    rows = [
        ["date", about.made],
        ["softstart", about.softstart],
        ["Python", about.python],
        ["libraries", ", ".join(f"{name} {version}" for name, version in about.libraries)],
    ]
    return html(
        table(["what", "which"], rows, caption="Made with", text_columns=(0, 1)),
        tag("p", "The command that made this report:", class_="lead") if about.command else None,
        tag("pre", about.command, class_="command") if about.command else None,
        tag("p", "The drive as a file for softstart, with all changes (drive.toml):", class_="lead"),
        tag("pre", about.drive_toml),
        tag(
            "p",
            "All starts are computed in closed form from event to event. The figures are as good as the "
            "data of the "
            "drive: check gap, stiffness and inertias first where measured starts differ.",
        ),
    )
