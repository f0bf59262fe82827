"""Optimal starts whose gap part counts too, as linear programs: lag, rate, torque-speed curve, braking.

Read in this order: answer.py (phases and what comes out), motion.py (the motion as rows over the variables),
program.py (the mathematics: what must hold, and the least peak for given instants), ways.py (which phases
follow each other), searching.py (the best instants, on finer and finer grids).
"""

from softstart.optimal.whole.searching import Instant, greatest_speed, search, solve
from softstart.optimal.whole.ways import Way, not_linear, ways

__all__ = ["Instant", "Way", "greatest_speed", "not_linear", "search", "solve", "ways"]
