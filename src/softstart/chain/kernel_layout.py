"""Where each number of a chain stands in the kernel's arrays.

Motor, encoder and controller are those of the two-mass plant, with its vectors `p`, `x` and `m`
(`softstart.plant.layout`). What a chain adds stands in matrices with a row a mass or a shaft.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from softstart import plant

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Cube = NDArray[np.float64]

ORDERS: Final = 36  # room for Taylor coefficients

# masses[i]: what is given; MEAN is the constant part of the exciting torques
J, GROUND, MC, REACTIVE, MEAN, W_0 = range(6)
N_MASSES: Final = 6
# shafts[k]: what is given
C, D, HALF, RIGID, RESTITUTION, LAW, THETA_0 = range(7)
N_SHAFTS: Final = 7
# tones[j]: one harmonic of an exciting torque: on which mass, frequency, cosine and sine amplitude
ON, OMEGA, COSINE, SINE = range(4)
N_TONES: Final = 4
# place: indices of masses, and the shafts from PATH to before PATH_END, which lead from motor to load
MOTOR, LOAD_MASS, PATH, PATH_END, MOTOR_SHAFT = range(5)
N_PLACES: Final = 5

# mass[i]: the state. DIRECTION: 0 stuck, +1 or -1 the sign of the speed that a reactive Mc opposes (an active
# load has +1 always). A body is what moves as one: FIRST is its first mass, where the others are found.
W, DIRECTION, FIRST, BODY_J, HOLD, STUCK, SIZE, INFLUENCE = range(8)
N_MASS: Final = 8
# shaft[k]: the state. MASK: how many leading coefficients of the event just fired are zero by its nature;
# STRUCK: the time of the last impact, BLOWS: how many were at that very instant
THETA, MODE, SIDE, MASK, PEAK, PEAK_TIME, IMPULSE, STRUCK, BLOWS = range(9)
N_SHAFT: Final = 9

# MODE: gap open; spring in contact; the same while `modelica` caps its damping; flanks overlap without
# torque; rigid flanks that press; a spring without a gap; a rigid joint
OPEN, CONTACT, DOUBLED, BEYOND, PRESSED, JOINED, WELDED = range(7)

# series[kind, row, order]: Taylor coefficients over the span, whose length is 1: speeds, twists, torques of
# shafts, torques from outside, and what holds a stuck body
SPEED, TWIST, TORQUE, OUTSIDE, HELD = range(5)
N_SERIES: Final = 5
# lines[kind, order]: motor torque, motor angle, an event function, scratch
U_LINE, PHI_LINE, EVENT_LINE, SPARE = range(4)
N_LINES: Final = 4

# a recorded span: time and motor, then w and DIRECTION of each mass, then twist, MODE and SIDE of each shaft
S_START, S_END, S_UA, S_UB, S_UE, S_PHI, S_MASS = range(7)
# a recorded event: `E_PLACE` is a shaft or a mass; of an impact the loss in J and the impulse in N m s
E_TIME, E_KIND, E_PLACE, E_VALUE, E_IMPULSE = range(5)
N_EVENT: Final = 5
CLOSED, OPENED, LOAD_STARTS, LOAD_STOPS, TARGET_REACHED, IMPACT, SETTLED = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0

# what a span ends with
(
    NO_EVENT, UPPER, LOWER, REJOIN, BACK, EXIT, SWITCH, SETTLE, RELEASE, BREAK_FORWARD, BREAK_BACK, STOP,
    REACHED, UNSOLVED,
) = range(14)  # fmt: skip


def row_width(count: int) -> int:
    """How many numbers a recorded span of `count` masses has."""
    return S_MASS + 2 * count + 3 * (count - 1)


def _drop_stale_cache() -> None:
    """As `softstart.plant` does: numba does not see changes in the files of the functions it calls."""
    here = Path(__file__).parent
    compiled = [*here.glob("__pycache__/kernel_*.nbi"), *here.glob("__pycache__/kernel_*.nbc")]
    sources = [*here.glob("kernel_*.py"), *Path(plant.__file__).parent.glob("*.py")]
    try:
        if compiled and max(p.stat().st_mtime for p in sources) > min(p.stat().st_mtime for p in compiled):
            for path in compiled:
                path.unlink(missing_ok=True)
    except OSError:
        return  # another process is compiling or cleaning, or the folder is read-only: numba decides


_drop_stale_cache()
