"""The compiled step of `state-feedback`: landing, Kalman filter, linear-quadratic feedback."""

from __future__ import annotations

import math

from softstart.controller import compiled_step
from softstart.controller.compiled import (
    ASK_AGAIN,
    MOTOR_ANGLE,
    MOTOR_TORQUE,
    STATE,
    TIME,
    TORQUE,
    Vector,
)
from softstart.plant.jit import compiled
from softstart_controllers import landing
from softstart_controllers.landing import (
    N_LANDING,
    N_LANDING_STATE,
    P_C,
    P_J1,
    P_LOW,
    P_MC,
    P_OMEGA,
    P_PATIENCE,
    P_PERIOD,
    P_SHARE,
    P_SIGMA,
    S_DEMAND,
    S_FREE_SPEED,
    S_OLDER_SLOPE,
    S_SAMPLE,
    S_TORQUE,
)
from softstart_controllers.sampled import mean_torque
from softstart_controllers.shaping import swing

# indices of the parameter vector, after those of the landing
(
    P_FULL, P_RISE, P_LAG, P_DEAD, P_LOAD_SHARE, P_F_TWIST, P_F_RATE, P_F_TORQUE,
    P_K_ANGLE, P_K_SPEED, P_K_TWIST, P_K_RATE, P_K_LOAD, P_OPENS,
) = range(N_LANDING, N_LANDING + 14)  # fmt: skip
# indices of the state, likewise
(
    S_PHASE, S_ANGLE, S_SPEED, S_Z, S_V, S_STUCK, S_LOAD, S_PROGRESS, N_STATE,
) = range(N_LANDING_STATE, N_LANDING_STATE + 9)  # fmt: skip
# values of S_PHASE
GAP_OPEN, CLOSED, IMPATIENT = 0.0, 1.0, 2.0


@compiled
def mean_twist(p: Vector, u: float, load: float) -> float:
    """Twist about which the closed drive swings, in rad, under the motor torque u and this load torque."""
    square = p[P_SIGMA] * p[P_SIGMA] + p[P_OMEGA] * p[P_OMEGA]
    return (u / p[P_J1] + load * p[P_LOAD_SHARE]) / square


@compiled
def predict(p: Vector, u: float, h: float, state: Vector, command: Vector) -> None:
    """The closed drive one sample on, from `state` to `command`."""
    z, v, load = state[S_Z], state[S_V], state[S_LOAD]
    speed = state[S_SPEED]
    a = u / p[P_J1] + load * p[P_LOAD_SHARE]
    if state[S_STUCK] != 0.0:
        end_z, end_v, still, _, gained = landing.move(p, z, v, 1.0, u, h)
        lost = h * (speed + 0.5 * h * u / p[P_J1]) - (end_z - z)
        command[STATE + S_STUCK] = still
    else:
        end_z, end_v = swing(z, v, mean_twist(p, u, load), p[P_SIGMA], p[P_OMEGA], h)
        lost = p[P_SHARE] * (h * (0.5 * h * a + v) - (end_z - z))
        gained = h * u / p[P_J1] - p[P_SHARE] * (h * a - (end_v - v))
        command[STATE + S_STUCK] = 0.0
    command[STATE + S_ANGLE] = state[S_ANGLE] + h * (speed + 0.5 * h * u / p[P_J1]) - lost
    command[STATE + S_SPEED] = speed + gained
    command[STATE + S_Z] = end_z
    command[STATE + S_V] = end_v


@compiled
def feedback(p: Vector, u: float, before: float, h: float, command: Vector) -> float:
    """The torque that the feedback asks for, within 0 and the full torque; raises the reference."""
    z, v, load = command[STATE + S_Z], command[STATE + S_V], command[STATE + S_LOAD]
    lag, dead = p[P_LAG], p[P_DEAD]
    if dead > 0.0:  # until then the last demand goes on acting
        left = math.exp(-dead / lag) if lag > 0.0 else 0.0
        mean = before + (u - before) * (1.0 - left) * lag / dead
        z, v = swing(z, v, mean_twist(p, mean, load), p[P_SIGMA], p[P_OMEGA], dead)
        u = before + (u - before) * left
    progress = command[STATE + S_PROGRESS]
    low, full = mean_twist(p, p[P_LOW], p[P_MC]), mean_twist(p, p[P_FULL], p[P_MC])
    reference = low + (full - low) * progress
    rate = (full - low) / p[P_RISE] if progress < 1.0 else 0.0
    command[STATE + S_PROGRESS] = min(1.0, progress + h / p[P_RISE])
    square = p[P_SIGMA] * p[P_SIGMA] + p[P_OMEGA] * p[P_OMEGA]
    Omega = math.sqrt(square)
    mean = reference - 2.0 * p[P_SIGMA] * rate / square - p[P_F_TWIST] * (z - reference)
    mean -= p[P_F_RATE] * (v - rate) / Omega
    mean -= p[P_F_TORQUE] * (mean_twist(p, u, load) - reference)
    demand = p[P_J1] * (mean * square - load * p[P_LOAD_SHARE])
    return min(max(demand, 0.0), p[P_FULL])


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Close the gap; from contact on estimate the state and feed it back."""
    p = parameters
    h = p[P_PERIOD]
    t = measured[TIME]
    u = measured[MOTOR_TORQUE]
    sample = state[S_SAMPLE]
    phase = state[S_PHASE]
    for i in range(S_PHASE, N_STATE):
        command[STATE + i] = state[i]
    if sample == 0.0:
        command[STATE + S_LOAD] = p[P_MC]
    demand = p[P_FULL]

    if phase == GAP_OPEN:
        speed, beyond = landing.watch(p, measured, state, command)
        demand = landing.approach(p, state, t, speed)
        if beyond > 0.0:
            phase = CLOSED
            stuck = landing.sticks(p, state)
            s, v = landing.contact_seen(
                p, state, t, u, beyond, command[STATE + S_FREE_SPEED], command[STATE + S_OLDER_SLOPE]
            )
            late = s * p[P_OMEGA] >= math.pi
            z, rate, still, _, gained = landing.move(p, 0.0, v, stuck, u, s)
            if late or z <= 0.0:  # seen so late that the phase of the swing is not known
                z, rate, still = 0.0, 0.0, stuck
            else:
                speed = v + landing.load_speed(p, state, t - s) + gained
            command[STATE + S_Z] = z
            command[STATE + S_V] = rate
            command[STATE + S_STUCK] = still
            command[STATE + S_SPEED] = speed
            command[STATE + S_ANGLE] = measured[MOTOR_ANGLE]
    else:
        for i in range(N_LANDING_STATE):
            command[STATE + i] = state[i]
        command[STATE + S_SAMPLE] = sample + 1.0
        command[STATE + S_TORQUE] = u
        if phase == CLOSED:
            predict(p, mean_torque(state[S_TORQUE], u, state[S_DEMAND]), h, state, command)
            error = measured[MOTOR_ANGLE] - command[STATE + S_ANGLE]
            command[STATE + S_ANGLE] += p[P_K_ANGLE] * error
            command[STATE + S_SPEED] += p[P_K_SPEED] * error
            if command[STATE + S_STUCK] != 0.0:  # the twist is the motor's own way
                command[STATE + S_Z] += p[P_K_ANGLE] * error
                command[STATE + S_V] += p[P_K_SPEED] * error
            else:
                command[STATE + S_Z] += p[P_K_TWIST] * error
                command[STATE + S_V] += p[P_K_RATE] * error
                command[STATE + S_LOAD] += p[P_K_LOAD] * error
            if p[P_C] * command[STATE + S_Z] < p[P_OPENS]:
                phase = GAP_OPEN
                motor = command[STATE + S_SPEED]
                landing.open_again(t, motor, motor - command[STATE + S_V], state, command)
                demand = p[P_LOW]

    if phase == CLOSED:
        demand = feedback(p, u, state[S_DEMAND], h, command)
    if t >= p[P_PATIENCE]:
        phase = IMPATIENT
        demand = p[P_FULL]

    command[TORQUE] = demand
    command[ASK_AGAIN] = math.inf if phase == IMPATIENT else (sample + 1.0) * h
    command[STATE + S_PHASE] = phase
    command[STATE + S_DEMAND] = demand
