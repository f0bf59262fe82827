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

# masses[i]: what is given; MEAN is the constant part of the exciting torques. RUBS: friction acts on the
# mass, of a reactive load (MC) or of a gear with losses; then ACTIVE is its active load torque, else MC is
J, GROUND, MC, RUBS, MEAN, W_0, ACTIVE = range(7)
N_MASSES: Final = 7
# shafts[k]: what is given; ETA: efficiency of its gear, which sits at mass k + GEAR (0 or 1)
C, D, HALF, RIGID, RESTITUTION, LAW, THETA_0, ETA, GEAR = range(9)
N_SHAFTS: Final = 9
# tones[j]: one harmonic of an exciting torque: on which mass, frequency, cosine and sine amplitude
ON, OMEGA, COSINE, SINE = range(4)
N_TONES: Final = 4
# place: indices of masses, and the shafts from PATH to before PATH_END, which lead from motor to load
MOTOR, LOAD_MASS, PATH, PATH_END, MOTOR_SHAFT = range(5)
N_PLACES: Final = 5

# mass[i]: the state. DIRECTION: 0 stuck, +1 or -1 the sign of the speed that friction opposes (+1 always
# where nothing rubs). A body is what moves as one: FIRST is its first mass, where the others are found;
# RUBBING and GEARS count its masses on which friction acts and its gears with losses; USED is the share of
# what can hold it that holds it at the beginning of a span, with the sign of what it is held against.
W, DIRECTION, FIRST, BODY_J, HOLD, STUCK, SIZE, INFLUENCE, RUBBING, GEARS, USED = range(11)
N_MASS: Final = 11
# shaft[k]: the state. MASK: how many leading coefficients of the event just fired are zero by its nature;
# STRUCK: the time of the last impact, BLOWS: how many were at that very instant; SIGN: of the torque, BEFORE
# and AFTER: the share of it that acts on the mass before and after, not 1 where its gear has losses
THETA, MODE, SIDE, MASK, PEAK, PEAK_TIME, IMPULSE, STRUCK, BLOWS, SIGN, BEFORE, AFTER = range(12)
N_SHAFT: Final = 12

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

# a recorded span: time and motor, then w and DIRECTION of each mass, then twist, MODE, SIDE and SIGN of
# each shaft
S_START, S_END, S_UA, S_UB, S_UE, S_PHI, S_MASS = range(7)
OF_SHAFT: Final = 4
# a recorded event: `E_PLACE` is a shaft or a mass; of an impact the loss in J and the impulse in N m s
E_TIME, E_KIND, E_PLACE, E_VALUE, E_IMPULSE = range(5)
N_EVENT: Final = 5
CLOSED, OPENED, LOAD_STARTS, LOAD_STOPS, TARGET_REACHED, IMPACT, SETTLED = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0
GEAR_LETS_GO, GEAR_HOLDS = 8.0, 9.0

# what a span ends with
(
    NO_EVENT, UPPER, LOWER, REJOIN, BACK, EXIT, SWITCH, SETTLE, RELEASE, BREAK_FORWARD, BREAK_BACK, STOP,
    REACHED, UNSOLVED, TURNED,
) = range(15)  # fmt: skip


def row_width(count: int) -> int:
    """How many numbers a recorded span of `count` masses has."""
    return S_MASS + 2 * count + OF_SHAFT * (count - 1)


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
