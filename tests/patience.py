"""How long a test may wait on a machine that does other work."""

from __future__ import annotations

import os


def patient(seconds: float) -> float:
    """A time that is enough on an idle machine, s, made longer where processes queue for the processors."""
    try:
        queue = max(os.getloadavg()[0] / (os.cpu_count() or 1), 0.0)
    except OSError:
        queue = 0.0
    return seconds * (1.0 + queue)
