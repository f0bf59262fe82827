"""The report for a customer: one HTML file that says which strategy, why, and what to set on the inverter."""

from __future__ import annotations

from softstart.reporting.project import Project
from softstart.reporting.resolution import Resolution
from softstart.reporting.result import Report, report

__all__ = ["Project", "Report", "Resolution", "report"]
