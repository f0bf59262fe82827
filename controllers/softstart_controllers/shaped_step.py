"""The compiled step of `shaped`: landing, the swing by the model, steps planned once and played."""

from __future__ import annotations

import math

from softstart.controller import compiled_step
from softstart.controller.compiled import ASK_AGAIN, MOTOR_TORQUE, STATE, TIME, TORQUE, Vector
from softstart.plant.jit import compiled
from softstart_controllers import landing, shaping
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

BRAKING = 4.0  # of T'/Omega, that the mean torque stays below T while no steps are found

# indices of the parameter vector, after those of the landing
P_ORDER, P_FULL, P_LAG, P_DEAD = range(N_LANDING, N_LANDING + 4)
# indices of the state, likewise
(
    S_PHASE, S_Z, S_V, S_STUCK, S_MOTOR_SPEED, S_D_REAL, S_D_IMAG, S_BEGIN, S_SAMPLES,
    S_FIRST, S_SECOND, S_THIRD, S_FOURTH, N_STATE,
) = range(N_LANDING_STATE, N_LANDING_STATE + 14)  # fmt: skip
# values of S_PHASE
GAP_OPEN, SWINGING, STEPPING, DONE = 0.0, 1.0, 2.0, 3.0


@compiled
def mean_level(p: Vector, u: float) -> float:
    """M = (u J2 + Mc J1)/(J1 + J2) in N m."""
    return p[P_C] * landing.mean_twist(p, u)


@compiled
def torque_of(p: Vector, level: float) -> float:
    """The motor torque of a mean shaft torque, not below zero."""
    return max(0.0, landing.motor_torque(p, level / p[P_C]))


@compiled
def follow(
    p: Vector, z: float, v: float, stuck: float, u: float, demand: float, s: float, contact: bool,
    command: Vector,
) -> None:  # fmt: skip
    """Twist, its rate, motor speed and the sensitivity D of `shaping` after the time s, by the model.

    D counts from the contact, or from where a stuck load breaks away; later, once no steps could be found,
    from the present sample.
    """
    end_z, end_v, still, moving, gained = landing.move(p, z, v, stuck, u, s)
    D = 0j
    if still == 0.0:
        level = mean_level(p, u)
        sigma, omega = p[P_SIGMA], p[P_OMEGA]
        inertia = p[P_SHARE] * p[P_J1]
        begin_z, begin_v = shaping.swing(end_z, end_v, level / p[P_C], sigma, omega, -moving)
        if contact or stuck != 0.0:
            D = shaping.sensitivity(begin_v, p[P_C] * begin_z, inertia, sigma, omega, p[P_LAG], level)
            W = shaping.vector(begin_z, begin_v, p[P_C], sigma, omega, p[P_LAG], level)
            D = shaping.later(D, W, mean_level(p, demand), sigma, omega, moving)
        else:
            D = shaping.sensitivity(end_v, p[P_C] * end_z, inertia, sigma, omega, p[P_LAG], level)
    command[STATE + S_Z] = end_z
    command[STATE + S_V] = end_v
    command[STATE + S_MOTOR_SPEED] += gained
    command[STATE + S_STUCK] = still
    command[STATE + S_D_REAL] = D.real
    command[STATE + S_D_IMAG] = D.imag


@compiled
def at_rest(p: Vector, u: float, stuck: float, command: Vector) -> None:
    """The shaft at rest under the motor torque u."""
    still = 1.0 if stuck != 0.0 and u <= p[P_MC] else 0.0
    command[STATE + S_Z] = u / p[P_C] if still != 0.0 else landing.mean_twist(p, u)
    command[STATE + S_V] = 0.0
    command[STATE + S_STUCK] = still
    command[STATE + S_D_REAL] = 0.0
    command[STATE + S_D_IMAG] = 0.0


@compiled
def prepare(p: Vector, u: float, demand: float, command: Vector) -> int:
    """Plan the steps from the state that the first of them meets; how many samples each level lasts."""
    lag, dead, c = p[P_LAG], p[P_DEAD], p[P_C]
    sigma, omega = p[P_SIGMA], p[P_OMEGA]
    z, v = command[STATE + S_Z], command[STATE + S_V]
    D = complex(command[STATE + S_D_REAL], command[STATE + S_D_IMAG])
    if dead > 0.0:  # until then the last demand goes on acting
        W = shaping.vector(z, v, c, sigma, omega, lag, mean_level(p, u))
        D = shaping.later(D, W, mean_level(p, demand), sigma, omega, dead)
        left = math.exp(-dead / lag) if lag > 0.0 else 0.0
        mean = demand + (u - demand) * (1.0 - left) * lag / dead
        z, v = shaping.swing(z, v, landing.mean_twist(p, mean), sigma, omega, dead)
        u = demand + (u - demand) * left
    W = shaping.vector(z, v, c, sigma, omega, lag, mean_level(p, u))
    lowest = max(0.0, mean_level(p, 0.0))
    n, M0, M1, M2, M3 = shaping.plan(
        int(p[P_ORDER]), W, D, lowest, mean_level(p, p[P_FULL]), sigma, omega, p[P_PERIOD]
    )
    command[STATE + S_SAMPLES] = n
    command[STATE + S_FIRST] = torque_of(p, M0)
    command[STATE + S_SECOND] = torque_of(p, M1)
    command[STATE + S_THIRD] = torque_of(p, M2)
    command[STATE + S_FOURTH] = torque_of(p, M3)
    return n


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Close the gap, follow the swing by the model, plan the steps once, play them."""
    p = parameters
    t = measured[TIME]
    u = measured[MOTOR_TORQUE]
    sample = state[S_SAMPLE]
    phase = state[S_PHASE]
    demand = p[P_FULL]
    for i in range(S_PHASE, N_STATE):
        command[STATE + i] = state[i]

    if phase == GAP_OPEN:
        speed, beyond = landing.watch(p, measured, state, command)
        demand = landing.approach(p, state, t, speed)
        if beyond > 0.0:
            phase = SWINGING
            s, v = landing.contact_seen(
                p, state, t, u, beyond, command[STATE + S_FREE_SPEED], command[STATE + S_OLDER_SLOPE]
            )
            command[STATE + S_MOTOR_SPEED] = v + landing.load_speed(p, state, t - s)
            stuck = landing.sticks(p, state)
            if s * p[P_OMEGA] < math.pi:
                follow(p, 0.0, v, stuck, u, state[S_DEMAND], s, True, command)
            if s * p[P_OMEGA] >= math.pi or command[STATE + S_Z] <= 0.0:
                # seen so late that the phase of the swing is not known: take its mean
                at_rest(p, u, stuck, command)
    else:
        for i in range(N_LANDING_STATE):
            command[STATE + i] = state[i]
        command[STATE + S_SAMPLE] = sample + 1.0
        command[STATE + S_TORQUE] = u
        if phase == SWINGING:
            mean = mean_torque(state[S_TORQUE], u, state[S_DEMAND])
            follow(p, state[S_Z], state[S_V], state[S_STUCK], mean, state[S_DEMAND], p[P_PERIOD], False,
                   command)  # fmt: skip
            if command[STATE + S_Z] < 0.0:
                phase = GAP_OPEN
                motor_speed = command[STATE + S_MOTOR_SPEED]
                landing.open_again(t, motor_speed, motor_speed - command[STATE + S_V], state, command)
                demand = p[P_LOW]

    if phase == SWINGING:
        if command[STATE + S_STUCK] != 0.0:
            demand = p[P_LOW]
        elif prepare(p, u, state[S_DEMAND], command) > 0:
            phase = STEPPING
            command[STATE + S_BEGIN] = sample
        else:  # the swing dies out where it is
            swing = BRAKING * command[STATE + S_V] / math.hypot(p[P_SIGMA], p[P_OMEGA])
            demand = min(torque_of(p, p[P_C] * (command[STATE + S_Z] - swing)), p[P_FULL])
    if phase == STEPPING:
        level = int((sample - command[STATE + S_BEGIN]) / command[STATE + S_SAMPLES])
        if level < int(p[P_ORDER]):
            demand = command[STATE + S_FIRST + level]
        else:
            phase = DONE
    elif t >= p[P_PATIENCE]:
        phase = DONE
        demand = p[P_FULL]

    command[TORQUE] = demand
    command[ASK_AGAIN] = math.inf if phase == DONE else (sample + 1.0) * p[P_PERIOD]
    command[STATE + S_PHASE] = phase
    command[STATE + S_DEMAND] = demand
