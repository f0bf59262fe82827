"""Torque steps that leave no swing behind, from any state of the swing: posicast, ZV and ZVD generalised.

*Poles and vectors.* The twist of the closed drive swings about its mean, z'' + 2 zeta Omega z' + Omega^2 z
= Omega^2 M/c, with the poles lambda, lambda* = -zeta Omega +- i Omega sqrt(1 - zeta^2). M = (u J2 + Mc J1)/
(J1 + J2) is the mean shaft torque under the motor torque u. The one free mode p = z' - lambda* z obeys p' =
lambda p + Omega^2 M/c. Let the demand of M be the level Delta_0 from t = 0 on and make steps Delta_i at t_i,
and let the torque follow it with a lag tau, M_y being reached at t = 0. Then no swing is left after the last
step if and only if

    W + sum Delta_i exp(-lambda t_i) = 0,     W = (lambda/Omega^2) (1 + lambda tau) c p + lambda tau M_y

The lag changes W only: it commutes with the shaper, and divides every step by the same 1 + lambda tau. An
impact at z = 0 with the speed v is the vector W = J1r v lambda (J1r = J1 J2/(J1 + J2)), undamped i c v/Omega:
as if a step had been made before. With nothing but that step, one more of the same size half a period later
stops the swing: posicast (Smith), or ZV (Singer and Seering) with the amplitudes 1/(1 + K) and K/(1 + K), K =
exp(-pi zeta/sqrt(1 - zeta^2)).

*Errors of the frequency.* W and the sum are functions of lambda. Where their derivative vanishes too, an
error of frequency or damping is felt in the second order only, the idea of ZVD:

    D - sum t_i Delta_i exp(-lambda t_i) = 0,     D = dW/dlambda

For a state that was measured D = J1r v (1 + 2 lambda tau) + tau (M_y - T).

*Levels.* The torque keeps the levels M_0 .. M_n-1, each for the time a, and M_f after that. With E =
exp(-lambda a) and Q(x) = sum M_k x^k,

    (1 - E) Q(E) + M_f E^n = -W                        ZV, n = 2: Q is linear
    d/dE of the left-hand side = D/(a E)               ZVD, n = 4: Q is cubic

Q is real, so its values at E and E* are known: Q(x) = A0 + A1 x + (B0 + B1 x) (x - E)(x - E*), all four in
closed form. Without damping and lag, a quarter of a period and an impact I = c v/Omega:

    ZV    M_0, M_1 = (M_f - I)/2, (M_f + I)/2
    ZVD   M_0, M_1 = M_f/4 - I (1/2 + 1/(2 pi)), M_f/4 + I (1 - 1/(2 pi))
          M_2, M_3 = 3 M_f/4 - I/(2 pi), 3 M_f/4 + I (1/2 - 1/(2 pi))

I = 0 gives the textbook shapers, ZV with I = M_f the pulse, coast and hold of the optimum.

*Duration.* `plan_levels` is the shortest a in whole samples whose levels rise: lowest <= M_0 <= ... <= M_f.

Sources: O. J. M. Smith, "Posicast control of damped oscillatory systems", Proc. IRE 45 (1957) 1249-1255;
N. C. Singer, W. P. Seering, "Preshaping command inputs to reduce system vibration", J. Dynamic Systems,
Measurement, and Control 112 (1990) 76-82. The state at contact and the closed form of the levels are ours.
"""

from __future__ import annotations

import math

from softstart.controller.compiled import compiled, inner

ZV, ZVD = 2, 4  # number of levels before the last one
ROUNDING = 1e-9  # of the last level, by which levels may fall
OVERSHOOT = 0.02  # of the last level, that T may leave its range by while the levels are played

Levels = tuple[float, float, float, float]
Complex = tuple[float, float]  # real and imaginary part: drives and PLCs have no complex numbers


@compiled
def oscillation(z: float, v: float, mean: float, sigma: float, omega: float, s: float) -> tuple[float, float]:
    """Twist and its rate after the time s: a damped swing about `mean` with the pole sigma + i omega.

    >>> z, v = oscillation(0.0, 2.0, 1.0, 0.0, 2.0, math.pi / 4)
    >>> round(z, 12), round(v, 12)
    (2.0, 2.0)
    """
    y = z - mean
    b = (v - sigma * y) / omega
    e = math.exp(sigma * s)
    cosine = e * math.cos(omega * s)
    sine = e * math.sin(omega * s)
    return mean + y * cosine + b * sine, v * cosine + (sigma * b - omega * y) * sine


@compiled
def product(x: Complex, y: Complex) -> Complex:
    """Of two complex numbers.

    >>> product((1.0, 2.0), (3.0, 4.0))
    (-5.0, 10.0)
    """
    return x[0] * y[0] - x[1] * y[1], x[0] * y[1] + x[1] * y[0]


@compiled
def quotient(x: Complex, y: Complex) -> Complex:
    """Of two complex numbers.

    >>> quotient((-5.0, 10.0), (3.0, 4.0))
    (1.0, 2.0)
    """
    square = y[0] * y[0] + y[1] * y[1]
    return (x[0] * y[0] + x[1] * y[1]) / square, (x[1] * y[0] - x[0] * y[1]) / square


@compiled
def vector(z: float, v: float, c: float, sigma: float, omega: float, lag: float, realised: float) -> Complex:
    """W of the state: twist z, its rate v, mean torque `realised` by now; N m.

    >>> vector(0.0, 2.0, 10.0, 0.0, 5.0, 0.0, 3.0)
    (0.0, 4.0)
    """
    square = sigma * sigma + omega * omega
    lagging = product((sigma, omega), (1.0 + sigma * lag, omega * lag))
    W = product(lagging, (v - sigma * z, omega * z))
    share, pull = c / square, lag * realised
    return share * W[0] + pull * sigma, share * W[1] + pull * omega


@compiled
def sensitivity(
    v: float, torque: float, inertia: float, sigma: float, omega: float, lag: float, realised: float
) -> Complex:
    """D = dW/dlambda of a shaft that carries `torque` and twists at the rate v; N m s."""
    impact = inertia * v
    return impact * (1.0 + 2.0 * sigma * lag) + lag * (realised - torque), impact * 2.0 * omega * lag


@compiled
def levels(order: int, W: Complex, D: Complex, last: float, sigma: float, omega: float, a: float) -> Levels:
    """The levels that leave no swing, each for the time a; ZV has two.

    >>> M0, M1, _, _ = levels(ZV, (0.0, 0.4), (0.0, 0.0), 1.0, 0.0, 2.0, 0.25 * math.pi)
    >>> round(M0, 12), round(M1, 12)
    (0.3, 0.7)
    """
    decay = math.exp(-sigma * a)
    E = (decay * math.cos(omega * a), -decay * math.sin(omega * a))
    rest = (1.0 - E[0], -E[1])
    square = product(E, E)
    if order == ZV:
        Q = quotient((-W[0] - last * square[0], -W[1] - last * square[1]), rest)
        A1 = Q[1] / E[1]
        return Q[0] - A1 * E[0], A1, last, last
    cube, fourth = product(square, E), product(square, square)
    Q = quotient((-W[0] - last * fourth[0], -W[1] - last * fourth[1]), rest)
    A1 = Q[1] / E[1]
    A0 = Q[0] - A1 * E[0]
    drift = quotient(D, (a * E[0], a * E[1]))
    slope_0 = drift[0] - ZVD * last * cube[0] + Q[0]
    slope_1 = drift[1] - ZVD * last * cube[1] + Q[1]
    slope = quotient((slope_0, slope_1), rest)
    B1 = 0.5 * (A1 - slope[0]) / (E[1] * E[1])
    B0 = 0.5 * slope[1] / E[1] - B1 * E[0]
    m1 = 2.0 * E[0]
    m0 = E[0] * E[0] + E[1] * E[1]
    return A0 + B0 * m0, A1 - B0 * m1 + B1 * m0, B0 - B1 * m1, B1


@inner
def extremes(
    order: int, T: float, rate: float, M: Levels, sigma: float, omega: float, a: float
) -> tuple[float, float]:
    """Largest and smallest T = c z while the levels are played, from T and its rate, without lag.

    A level lasts less than half a period, so T turns at most once in it: where its rate, e^(sigma t) (rate
    cos omega t + q sin omega t), is zero.
    """
    largest = smallest = T
    for k in range(order):
        q = (sigma * rate - (sigma * sigma + omega * omega) * (T - M[k])) / omega
        T_end, rate_end = oscillation(T, rate, M[k], sigma, omega, a)
        if rate * rate_end < 0.0:
            turn = math.atan2(abs(rate), -math.copysign(q, rate * q)) / omega
            T, _ = oscillation(T, rate, M[k], sigma, omega, turn)
            largest, smallest = max(largest, T), min(smallest, T)
        T, rate = T_end, rate_end
        largest, smallest = max(largest, T), min(smallest, T)
    return largest, smallest


@compiled
def plan_levels(
    order: int, W: Complex, D: Complex, lowest: float, last: float, sigma: float, omega: float, period: float
) -> tuple[int, float, float, float, float]:
    """Samples of each level and the levels; 0 samples where no plan has levels that rise.

    Nor may T leave the range from 0 to the last level meanwhile, once what the lag still owes is counted in.

    >>> n, M0, M1, _, _ = plan_levels(ZV, (0.0, 0.0), (0.0, 0.0), 0.0, 1.0, 0.0, 2.0 * math.pi, 0.01)
    >>> n, round(M0, 9), round(M1, 9)  # a quarter: 25 samples
    (25, 0.5, 0.5)
    """
    p = quotient(W, (sigma, omega))  # of the state without lag that has this W
    T = (sigma * sigma + omega * omega) * p[1] / omega
    rate = (sigma * sigma + omega * omega) * (p[0] + sigma * p[1] / omega)
    slack = ROUNDING * abs(last)
    highest = max(T, last) + OVERSHOOT * abs(last)
    n = 1
    while n * period * omega < math.pi:
        M = levels(order, W, D, last, sigma, omega, n * period)
        if (
            lowest - slack <= M[0] <= M[1] + slack
            and M[1] <= M[2] + slack
            and M[2] <= M[3] + slack
            and M[3] <= last + slack
        ):
            largest, smallest = extremes(order, T, rate, M, sigma, omega, n * period)
            if largest <= highest and smallest >= -OVERSHOOT * abs(last):
                return n, M[0], M[1], M[2], M[3]
        n += 1
    return 0, last, last, last, last
