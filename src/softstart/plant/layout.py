"""Where each number of the plant stands in the kernel's flat arrays.

The compiled kernel works on float64 vectors: `p` (the drive), `x` (the state of one start and what
has been noted of it), `m` (the motion of the span being solved). The names below are their indices.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Pair = tuple[float, float]
Triple = tuple[float, float, float]
Quintuple = tuple[float, float, float, float, float]
Septuple = tuple[float, float, float, float, float, float, float]

# p: the drive
(
    J1, J2, C, D, GAP, MC, REACTIVE, LAW, LAG, RATE, U_MIN, U_MAX,
    TARGET, ENCODER, THETA_0, W1_0, W2_0, PERIOD, TIME_LIMIT, EVENT_CAP,
    INV_J1, INV_J2, INV_J, W0SQ_SLIP, INV_W0SQ, W0_SLIP,  # derived: divisions are dear
    ENCODER_PHASE, TORQUE_NOISE, NOISE_SEED, DEAD_TIME,
) = range(30)  # fmt: skip
N_P: Final = 30

# contact laws
NO_PULL, DEAD_ZONE, MODELICA = 0.0, 1.0, 2.0

# x: the state. theta = phi1 - phi2 and v = w1 - w2 are kept, not their parts: the gap is then as
# sharp after a minute as at the start.
(
    TIME, THETA, V, PHI2, W2, REF, U, DEMAND, DEMAND_SLOPE,  # REF: the demand after the slew limiter
    SIDE,  # 0 gap open, +1 or -1 the flank in contact
    DOUBLED,  # 1 while the `modelica` law's damping is capped by its spring: T = 2 c z
    BEYOND,  # +1 or -1: no torque though the flanks overlap: a damped spring that must not pull springs back
    LOAD,  # 0 stuck, +1 or -1 sign of the speed that Mc opposes; an active load has +1 always
    MASK,  # the event that has just fired, see advance.py
    ASK_AT, ASK_ON_GAP, T_END, SAMPLE_ANGLE, SAMPLE_TIME, ASKED,
    # what is noted
    STAGE, STAGE_START, STAGE_PEAK, STAGE_PEAK_TIME, PEAK, PEAK_TIME, GAP_EVENTS, CONTACTS,
    FIRST_CONTACT, STAGE_2_END, IMPACT_SPEED, CONTACT_TORQUE, FIRST_PEAK, START_TIME, EVENTS,
    N_SEGMENTS, N_EVENTS, N_STAGES, STATUS,
) = range(39)  # fmt: skip
N_X: Final = 39

# m: the motion of one span, see motion.py
(
    FREE, Z0, V0, FA, FB, FE, LAMBDA, W0SQ, ZETA, Q, ROOT_Q, P0, P1, P2, Y0, YV0, BRANCH, K, DD,
    UA, UB, UE, SLEW_END,  # motor torque of the span
    LAST_V,  # the speed at its end where that is known without evaluating the motion
    W0, STEADY,  # w0; 1 for an undamped spring under constant torque, whose events are closed formulas
    MEMO_V, MEMO_P, MEMO_W, MEMO_S,  # the last contact's entry and duration: under constant torque it repeats
    MEMO_DONE,  # 1 once that contact has run from flank to flank, its peak noted
    END_KNOWN, END_Z, END_V,  # the motion at the end of the span, once it has been evaluated
    PASSING,  # when, within this contact, the load passes its target speed; NaN if it does not
    PENDING,  # how many answers of the controller are on their way (computing_delay); from QUEUE on they wait
    QUEUE,
) = range(37)  # fmt: skip
Q_TIME, Q_DEMAND, Q_SLOPE = range(3)  # of an answer that waits: when it takes effect, and what it is
N_WAITING: Final = 3
MOST_PENDING: Final = 16
N_M: Final = QUEUE + N_WAITING * MOST_PENDING

# a recorded span: enough to evaluate every state within it exactly
(
    S_START, S_END, S_STAGE, S_SIDE, S_LOAD, S_THETA, S_V, S_PHI2, S_W2, S_UA, S_UB, S_UE, S_K, S_DD,
) = range(14)  # fmt: skip
N_SEGMENT: Final = 14

# a recorded event
E_TIME, E_KIND, E_VALUE = range(3)
N_EVENT: Final = 3
CLOSED, OPENED, LOAD_STARTS, LOAD_STOPS, TARGET_REACHED = 1.0, 2.0, 3.0, 4.0, 5.0

# a recorded stage
G_NUMBER, G_START, G_END, G_SIDE, G_PEAK, G_PEAK_TIME = range(6)
N_STAGE: Final = 6

# why `advance` came back
ASK, ENDED, BUFFER_FULL, EVENT_LIMIT, NOT_LOCATED, NOT_FINITE, BAD_COMMAND, QUEUE_FULL = range(8)

# what a span ends with
(
    NO_EVENT, UPPER, LOWER, GRAZE_UPPER, GRAZE_LOWER, REJOIN, BACK, EXIT, SWITCH, BREAKAWAY, STOP, REACHED,
    UNSOLVED,
) = range(13)  # fmt: skip

# masks: the event that has just fired must not fire again at the instant at which the span begins
NOTHING, LEFT_UPPER, LEFT_LOWER, LEFT_BEYOND, SWITCHED, BROKE_AWAY = range(6)
