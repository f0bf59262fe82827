"""The report for a customer: one HTML file that says which strategy, why, and what to set on the inverter."""

from __future__ import annotations

from softstart.reporting.result import Report, report
from softstart.start.resolution import Resolution

__all__ = ["Report", "Resolution", "report"]
