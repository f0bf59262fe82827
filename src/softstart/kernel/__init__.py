"""The one kernel: N masses on shafts with gaps, exact from event to event; a drive is two masses.

Its files, in the order in which they build on each other: `records` (where each number stands), `motor`
(what passes between machine and controller, and the torque of the motor), `series` (the Taylor polynomials of
a span), `events` (the first root that ends it), `modes` (what changes then), `start` (span after span; many
starts), `replay` (any instant of a recorded start), `sensitivity` (its derivatives).
"""

from __future__ import annotations

from pathlib import Path

from softstart.kernel.jit import drop_stale

drop_stale(Path(__file__).parent.glob("*.py"))
