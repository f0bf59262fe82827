"""Projects: the machines, strategies, optima and duties of a job, and what was chosen, in one TOML file."""

from __future__ import annotations

from softstart.project.file import Project
from softstart.project.parts import StoredOptimum

__all__ = ["Project", "StoredOptimum"]
