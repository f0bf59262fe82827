"""The report for a customer: one HTML file that says which strategy, why, and what to set on the inverter."""

from __future__ import annotations

from softstart.reporting.chain_report import ChainReport, report_chain
from softstart.reporting.project import Project
from softstart.reporting.resolution import Resolution
from softstart.reporting.result import Report, report
from softstart.reporting.translation import Translation, write_sentences

__all__ = [
    "ChainReport",
    "Project",
    "Report",
    "Resolution",
    "Translation",
    "report",
    "report_chain",
    "write_sentences",
]
