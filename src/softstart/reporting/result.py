"""What a report holds: the data behind everything that it says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from softstart.drive import Drive
from softstart.export import write_whole
from softstart.reporting.choice import Choice
from softstart.reporting.limit import Limit, bound_at
from softstart.reporting.provenance import Provenance
from softstart.reporting.resolution import Resolution
from softstart.reporting.sheet import Sheet
from softstart.reporting.strategies import label_of
from softstart.start.comparison import Comparison, Row


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """A drive, its strategies compared, the limit, maps, the recommendation and its parameter sheets.

    `failed` are strategies whose start could not be finished, with the reason. `sheets` begins with that of
    the recommended strategy, then the best of an ordinary inverter, if these are two.
    """

    drive: Drive
    comparison: Comparison
    failed: tuple[tuple[str, str], ...]
    limit: Limit
    choice: Choice
    sheets: tuple[Sheet, ...]
    resolution: Resolution
    provenance: Provenance

    def __repr__(self) -> str:
        """One line that says what is recommended."""
        best = self.choice.recommended
        said = f"{best.name}, K_dyn {best.row.run.k_dyn:.3f}" if best else "nothing"
        return f"<Report: {said} recommended for {self.drive.name}>"

    def row(self, name: str) -> Row | None:
        """The row of a strategy."""
        return next((row for row in self.comparison.rows if label_of(row.run.controller) == name), None)

    def lower_bound(self, row: Row) -> float | None:
        """The K_dyn that no start as quick as this one can go below."""
        return None if math.isnan(row.run.start_time) else bound_at(self.drive, row.run.start_time)

    def gentlest_known(self, row: Row) -> float | None:
        """Least K_dyn of all starts that this report knows and that take no longer than this one."""
        time = row.run.start_time
        own = [other.run for other in self.comparison.rows if other.run.start_time <= time]
        found = [run.k_dyn for run in own] + [self.limit.gentlest_known(time)]
        return min((k for k in found if k is not None), default=None)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON, under the names used everywhere."""
        best, plain = self.choice.recommended, self.choice.ordinary
        direct = self.row("direct")
        return {
            "drive": self.drive.name,
            "recommended": best.name if best else None,
            "k_dyn": best.row.run.k_dyn if best else None,
            "start_time": best.row.run.start_time if best else None,
            "peak_torque": best.row.run.peak_torque if best else None,
            "k_dyn_lower_bound": self.lower_bound(best.row) if best else None,
            "k_dyn_gentlest_known": self.gentlest_known(best.row) if best else None,
            "k_dyn_direct": direct.run.k_dyn if direct else None,
            "start_time_direct": direct.run.start_time if direct else None,
            "ordinary": plain.name if plain else None,
            "k_dyn_ordinary": plain.row.run.k_dyn if plain else None,
            "strategies": [
                {**row.summary(), "k_dyn_lower_bound": self.lower_bound(row)} for row in self.comparison.rows
            ],
            "failed": dict(self.failed),
            "choice": self.choice.summary(),
            "maps": {one.name: one.map.summary() for one in self.choice.candidates},
            "limit": self.limit.summary(),
            "sheets": [sheet.summary() for sheet in self.sheets],
            "provenance": self.provenance.summary(),
        }

    def to_html(self) -> str:
        """The report as one HTML file that needs nothing else."""
        from softstart.reporting.document import document

        return document(self)

    def write(self, path: str | Path) -> None:
        """Write the HTML file, whole or not at all."""
        text = self.to_html()
        write_whole(Path(path), lambda stream: stream.write(text))
