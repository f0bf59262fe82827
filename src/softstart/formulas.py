"""A start in closed form: equations (1) to (18) of [G] over arrays, and the whole direct start.

While the gap is open (odd stages) motor and load move freely; while it is closed (even stages) the shaft
torque `T` (`M12` in [G]) swings about the mean that accelerates both masses alike. No dissipation.
`open_stage` and `contact_stage` are the first opening and the first contact of a start from rest in mid-gap,
`two_stages` joins them to K_dyn; `DirectStarts` is the whole start under constant torque.
`softstart.simulate` does the rest: damping, torque lag, limits, feedback.

Arguments are floats or arrays that broadcast together, in SI units with angles in rad at the motor shaft;
floats in give floats out, otherwise arrays of the broadcast shape. Arguments outside their range (`J1 <= 0`,
`gap < 0`, NaN ...) raise one `InputError` that names them all.

Symbols: `J1, J2` inertias of motor and load, kg m2; `c` stiffness, N m/rad; `gap` total angular gap, rad;
`M1` motor torque of the stage, `Mc` load torque, `Ms` starting torque, N m; `dw12` speed of impact, rad/s;
`t` time since the stage began, s.

Load. An active load torque acts always, so it turns a free load backwards; (1) to (18) hold for it. A
reactive one (Coulomb friction, `kind="reactive"`) leaves the load at rest in stage 1: the terms with `Mc`
vanish from (2) to (6) and (10). That is all [G] says of it. In stage 2 such a load stays stuck until
`T > Mc`:

    T = M1 (1 - cos ws t) + B sin ws t,     ws = sqrt(c/J1),  B = dw12 sqrt(c J1)

At `T = Mc` the torque rises at `ws S`, `S^2 = B^2 + Mc (2 M1 - Mc)` (energy); if `S^2 <= 0` it never gets
there. From then on the load slips and `T` swings with the frequency Omega of the whole drive, `s` counted
from the break-away:

    T = Mc + over (1 - cos Omega s) + rise sin Omega s,     over = (M1 - Mc) share,  rise = S sqrt(share),
                                                            share = J2/(J1 + J2)

A load with an active part and friction besides is a reactive one with the sum `Mc` where its friction holds
it at rest (`Drive.rests`); where not, it falls, stops and rises within stage 2, which has no closed form.

[G]: R. P. Gerasymiak, V. V. Subbotin, Dual-mass mechanical part electromechanical system behavior analysis,
pages 18-20. Derivations: docs/theory/stages.md. Doctests: its crane drive with J2 = 5 J1.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.drive.checks import elastic_frequency, mean_torque_of
from softstart.errors import InputError

Value = Any  # a float where all arguments are, otherwise an array

ABOVE_ZERO = {"J1", "J2", "c", "Ms", "base", "target_speed"}
NOT_NEGATIVE = {"gap", "t", "dw12"}


class OpenStage(NamedTuple):
    """How an open stage ends: s, rad, rad/s; see `open_stage`."""

    duration: Value
    phi1: Value
    phi2: Value
    w1: Value
    w2: Value
    dw12: Value


class ContactStage(NamedTuple):
    """Peak of the shaft torque in a contact, N m, when it is reached, and how long the contact lasts, s."""

    peak: Value
    peak_time: Value
    duration: Value


class TwoStages(NamedTuple):
    """K_dyn and peak in N m of the first contact, durations in s of the first two stages."""

    k_dyn: Value
    peak: Value
    open_duration: Value
    contact_duration: Value


def mean_shaft_torque(M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike) -> float | Vector:
    """Torque in N m that accelerates both masses alike: `M12avg = (M1 J2 + J1 Mc)/(J1 + J2)`, [G](11).

    With `M1 = Ms` it is `M12avg_base` of [G](16). Arguments and errors: `softstart.formulas`.

    >>> round(mean_shaft_torque(62, 0.035, 0.175, 7.16), 6)
    52.86
    """
    M1, J1, J2, Mc = _checked(M1=M1, J1=J1, J2=J2, Mc=Mc)
    return _plain(mean_torque_of(M1, J1, J2, Mc))


def dynamic_coefficient(peak: ArrayLike, base: ArrayLike) -> float | Vector:
    """K_dyn = |peak|/base, [G](16): the one place where a K_dyn is computed.

    `peak` and `base` in N m; `base` is `mean_shaft_torque(Ms, J1, J2, Mc)` of this drive or of the one it is
    compared with, and above zero (`InputError`).

    >>> round(dynamic_coefficient(164.81, 52.86), 4)
    3.1179
    """
    peak, base = _checked(peak=peak, base=base)
    return _plain(np.abs(peak) / base)


def open_stage(
    M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, gap: ArrayLike, *, kind: str = "active"
) -> OpenStage:
    """Stage 1 from rest in mid-gap until the gap closes, [G](1) to (6) and (10).

    With `J1 phi1'' = M1`, `J2 phi2'' = -Mc` (1) it lasts `t1 = sqrt(gap J1 J2/(M1 J2 + Mc J1))` (3) and ends
    at `phi1 = M1 t1^2/(2 J1)`, `phi2 = -Mc t1^2/(2 J2)` (2), (6), with `w1 = M1 t1/J1`, `w2 = -Mc t1/J2` (4),
    (5) and the speed of impact `dw12 = w1 - w2` (10). Arguments and errors: `softstart.formulas`; raises
    `InputError` too where the masses do not approach each other.

    >>> stage = open_stage(62, 0.035, 0.175, 7.16, 0.5)
    >>> round(stage.duration, 6), round(stage.phi1, 6), round(stage.w2, 4), round(stage.dw12, 4)
    (0.01661, 0.244356, -0.6796, 30.1027)
    """
    M1, J1, J2, Mc, gap = _checked(M1=M1, J1=J1, J2=J2, Mc=Mc, gap=gap)
    if _reactive(kind, Mc):
        Mc = np.zeros_like(Mc)
    a = _approach(M1, J1, J2, Mc)
    t1, half = np.sqrt(gap / a), gap / 2 / a
    end = half * M1 / J1, -half * Mc / J2, M1 * t1 / J1, -Mc * t1 / J2, np.sqrt(gap * a)
    return OpenStage(*_alike(t1, *end))


def shaft_torque(
    t: ArrayLike, M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, c: ArrayLike, dw12: ArrayLike
) -> Value:
    """Shaft torque in N m at time t of a contact stage, active load, [G](11).

    `T = M12avg (1 - cos Omega t) + (c dw12/Omega) sin Omega t`, Omega as in `contact_stage`, until it is back
    at zero; later values pull and mean nothing. Arguments and errors: `softstart.formulas`.

    >>> round(shaft_torque(0.01, 62, 0.035, 0.175, 7.16, 368.465, 30.1027), 2)
    119.01
    """
    t, M1, J1, J2, Mc, c, dw12 = _checked(t=t, M1=M1, J1=J1, J2=J2, Mc=Mc, c=c, dw12=dw12)
    Omega = elastic_frequency(J1, J2, c)
    sin, cos = np.sin(Omega * t / 2), np.cos(Omega * t / 2)  # half angles: 1 - cos would cancel after contact
    return _plain(2 * sin * (mean_shaft_torque(M1, J1, J2, Mc) * sin + c * dw12 / Omega * cos))


def contact_stage(
    M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike, c: ArrayLike, dw12: ArrayLike,
    kind: str = "active",
) -> ContactStage:  # fmt: skip
    """A contact that begins with the speed `dw12`, [G](7) to (15).

    Active load: the twist beyond the gap obeys `M12''/Omega^2 + M12 = M12avg`, `Omega^2 = c (J1 + J2)/(J1
    J2)` (7), (8) with `M12(0) = 0`, `M12'(0) = c dw12` (9). With `B = c dw12/Omega` the torque swings about
    M12avg with the amplitude `sqrt(M12avg^2 + B^2)` and the phase `psi = atan(M12avg/B)` (12), so

        peak = M12avg + amplitude (13), peak_time = (pi/2 + psi)/Omega (14), duration = 2 peak_time (15)

    which holds for `M12avg <= 0` (motor braking in stage 2) as well. A reactive load is at rest at contact;
    `peak` is then `Mc + over + sqrt(over^2 + rise^2)`, or `M1 + sqrt(M1^2 + B^2)` where it stays stuck.
    `duration` is `inf` where the load moves and `c J2 dw12^2 <= Mc^2`: friction holds the flanks together. It
    is `nan` where the load stops again before the gap opens, which takes `M1 < Mc`: that instant has no
    closed form. Arguments and errors: `softstart.formulas`; raises `InputError` too for friction `Mc < 0`.

    >>> [round(value, 4) for value in contact_stage(62, 0.035, 0.175, 7.16, 368.465, 30.1027)]
    [164.8096, 0.0184, 0.0367]
    >>> dw12 = open_stage(62, 0.035, 0.175, 7.16, 0.5, kind="reactive").dw12
    >>> [round(v, 4) for v in contact_stage(62, 0.035, 0.175, 7.16, 368.465, dw12, "reactive")]
    [163.7848, 0.0184, 0.0368]
    """
    M1, J1, J2, Mc, c, dw12 = _checked(M1=M1, J1=J1, J2=J2, Mc=Mc, c=c, dw12=dw12)
    Omega, share = elastic_frequency(J1, J2, c), J2 / (J1 + J2)
    if not _reactive(kind, Mc):
        mean, B = mean_torque_of(M1, J1, J2, Mc), c * dw12 / Omega
        to_peak = np.arctan2(B, -mean)  # pi/2 + psi, accurate also where psi is near -pi/2
        return ContactStage(*_alike(_peak(mean, B), to_peak / Omega, 2 * to_peak / Omega))
    ws, B = np.sqrt(c / J1), dw12 * np.sqrt(c * J1)
    S2 = B**2 + Mc * (2 * M1 - Mc)
    S, moves = np.sqrt(np.maximum(S2, 0)), (S2 > 0) | (Mc == 0)
    over, rise = (M1 - Mc) * share, S * np.sqrt(share)
    to_break_away = 2 * np.arctan2(Mc, B + S) / ws  # tan(ws t/2) = Mc/(B + S), the root that does not cancel
    to_peak, stuck = np.arctan2(rise, -over), np.arctan2(B, -M1) / ws
    below2 = share * B**2 - (1 - share) * Mc**2  # amplitude^2 - mean^2; T comes down to zero only if >= 0
    angle = to_peak + np.arctan2(np.sqrt(np.maximum(below2, 0)), -(Mc + over))
    # Proportional to w2 where T is back at zero; w2 rises and falls once, so its sign tells of a stop before.
    w2 = over * (angle - np.sin(angle)) + rise * (1 - np.cos(angle))
    opens = np.where(w2 >= 0, to_break_away + angle / Omega, np.nan)
    slipping = np.where((below2 <= 0) & (Mc > 0), np.where(over >= 0, np.inf, np.nan), opens)
    peak = np.where(moves, Mc + _peak(over, rise), _peak(M1, B))
    peak_time = np.where(moves, to_break_away + to_peak / Omega, stuck)
    return ContactStage(*_alike(peak, peak_time, np.where(moves, slipping, 2 * stuck)))


def two_stages(
    M1_open: ArrayLike, M1_contact: ArrayLike, *, J1: ArrayLike, J2: ArrayLike, c: ArrayLike, gap: ArrayLike,
    Ms: ArrayLike, Mc: ArrayLike, kind: str = "active", base: ArrayLike | None = None,
) -> TwoStages:  # fmt: skip
    """Stages 1 and 2 with a motor torque of its own in each, [G](16) to (18); durations: fig. 4 of [G].

    With `M(n) = M1(n) J2 + Mc J1`, stage 1 open and stage 2 in contact, an active load has

        K_dyn = M(2)/((J1 + J2) base) (1 + sqrt(1 + Omega^2 J1 J2 gap M(1)/M(2)^2))          (18)

    Method 1 of [G] reduces the torque while the gap is open, `two_stages(r Ms, Ms)`, which is (17) and never
    below 2; method 2 in both stages, `two_stages(r Ms, r Ms)`. `base` in N m is the mean shaft torque for
    K_dyn, by default this drive's own (fig. 2 of [G] takes that of `J2 = 5 J1` for all curves). A reactive
    load is taken exactly. Arguments and errors: `open_stage` and `contact_stage`.

    >>> crane = {"J1": 0.035, "J2": 0.175, "c": 368.465, "Ms": 62, "Mc": 7.16}
    >>> round(two_stages(15.5, 62, gap=0.5, **crane).k_dyn, 4)
    2.3894
    >>> two_stages(15.5, 15.5, gap=[0.5, 2], **crane).k_dyn.round(4)
    array([1.2677, 2.2144])
    """
    _checked(M1_open=M1_open, M1_contact=M1_contact, J1=J1, J2=J2, c=c, gap=gap, Ms=Ms, Mc=Mc)
    start = open_stage(M1_open, J1, J2, Mc, gap, kind=kind)
    contact = contact_stage(M1_contact, J1, J2, Mc, c, start.dw12, kind)
    k_dyn = dynamic_coefficient(contact.peak, mean_shaft_torque(Ms, J1, J2, Mc) if base is None else base)
    return TwoStages(*_alike(k_dyn, contact.peak, start.duration, contact.duration))


class DirectStarts:
    """Whole starts from rest under the constant torque `Ms`, undamped, active load: millions in one call.

    The twist `theta = phi1 - phi2` falls with the acceleration `a = Ms/J1 + Mc/J2` onto the driving flank, is
    in contact for `(pi + 2 psi)/Omega` (15), and flies back to where it began, at rest: every contact has the
    peak (13), and all repeats itself while the momentum grows as `(Ms - Mc) t`. The load gains speed while
    `T > Mc`. In the first period in which that suffices Newton's method finds the start time. It begins at
    the peak of `T`, where `w2` turns from convex to concave, so it runs to the crossing from one side.

    `theta0` in rad is the twist at the start, from `-gap/2` (opposite flank) over 0 (mid-gap) and `gap/2`
    (driving flank) to `gap/2 + mean/c` (shaft wound up; a load that hangs has wound it up by `Mc/c`).
    Attributes, floats or arrays of one shape: `k_dyn`, `peak` in N m, and in s `start_time`, `first_contact`
    (0 if closed from the start), `contact_duration`, `period`. A load that drives (`Mc < 0`) may be at speed
    before the first contact; `k_dyn` is that of the contacts all the same. Arguments and errors:
    `softstart.formulas`; raises `InputError` too for `Ms <= Mc` and where the masses do not approach.

    >>> crane = {"J1": 0.035, "J2": 0.175, "c": 368.465, "Ms": 62, "Mc": 7.16, "target_speed": 92}
    >>> starts = DirectStarts(**crane, gap=[0.5, 2.0])
    >>> starts.k_dyn.round(4), starts.start_time.round(4)
    (array([3.1179, 4.8654]), array([0.3732, 0.3477]))
    """

    def __init__(
        self, *, J1: ArrayLike, J2: ArrayLike, c: ArrayLike, gap: ArrayLike, Ms: ArrayLike, Mc: ArrayLike,
        target_speed: ArrayLike, theta0: ArrayLike = 0.0,
    ) -> None:  # fmt: skip
        given = {"J1": J1, "J2": J2, "c": c, "gap": gap, "Ms": Ms, "Mc": Mc, "theta0": theta0}
        *parts, target = np.broadcast_arrays(*_checked(**given, target_speed=target_speed))
        J1, J2, c, gap, Ms, Mc, theta0 = parts
        self._J1, self._J2, self._c, self._theta0 = J1, J2, c, theta0
        self._flank, self._excess, self._a = gap / 2, Ms - Mc, _approach(Ms, J1, J2, Mc)
        way, mean = self._flank - theta0, mean_torque_of(Ms, J1, J2, Mc)
        self._wound = c * np.maximum(-way, 0)  # torque of a shaft that is wound up at the start
        if np.any(self._excess <= 0):
            raise InputError("Ms <= Mc: such a starting torque cannot move the load; raise it.")
        if np.any((way > gap) | (self._wound > mean)):
            raise InputError("theta0: a direct start begins between -gap/2 and gap/2 + mean/c.")
        Omega, first = elastic_frequency(J1, J2, c), np.sqrt(2 * np.maximum(way, 0) / self._a)
        self._Omega, self._lift, self._B = Omega, mean - self._wound, c * self._a * first / Omega
        amplitude, psi = np.hypot(self._lift, self._B), np.arctan2(self._lift, self._B)
        contact = (np.pi + 2 * psi) / Omega
        figures = mean + amplitude, first, contact, 2 * first + contact
        self.peak, self.first_contact, self.contact_duration, self.period = _alike(*figures)
        self.k_dyn = dynamic_coefficient(self.peak, mean)

        # w2 is highest where T falls back to Mc; if Mc < 0 it never falls
        falling = np.arcsin(np.clip((Mc - mean) / np.maximum(amplitude, 1e-300), -1, 1))
        highest = np.where(Mc < 0, self.period, first + (np.pi + psi - falling) / Omega)
        gain = self._excess * self.period / (J1 + J2)
        before = np.maximum(np.ceil((target - self.at(highest)["w2"]) / gain), 0)
        t, side = (before + 0.5) * self.period, np.zeros_like(gain)
        for _ in range(100):
            state = self.at(t)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = (target - state["w2"]) * J2 / (state["T"] - Mc)
            side = np.where(side == 0, np.sign(step), side)
            step = np.where(step * side > 0, step, 0)  # rounding alone turns round
            if np.all(t + step == t):
                break
            t = t + step
        self.start_time = _plain(t)

    def at(self, t: ArrayLike) -> dict[str, Value]:
        """Angles `phi1, phi2` in rad, speeds `w1, w2` in rad/s, shaft torque `T` in N m at times `t` in s."""
        (t,) = _checked(t=t)
        into = t - np.floor(t / self.period) * self.period
        back = into > self.period / 2  # a period is symmetric about its middle, where T is at its peak
        into = np.where(back, self.period - into, into)
        half = self._Omega * np.maximum(into - self.first_contact, 0) / 2
        sin, cos, closed = np.sin(half), np.cos(half), into >= self.first_contact
        T = self._wound + 2 * sin * (self._lift * sin + self._B * cos)
        v = (2 * self._lift * sin * cos + self._B * (cos - sin) * (cos + sin)) * self._Omega / self._c
        v = np.where(back, -1, 1) * np.where(closed, v, self._a * into)
        theta = np.where(closed, self._flank + T / self._c, self._theta0 + self._a * into**2 / 2)
        J = self._J1 + self._J2
        w2 = (self._excess * t - self._J1 * v) / J  # J1 w1 + J2 w2 = (Ms - Mc) t
        phi2 = (self._excess * t**2 / 2 - self._J1 * (theta - self._theta0)) / J
        values = _alike(phi2 + theta, phi2, w2 + v, w2, np.where(closed, T, 0))
        return dict(zip(("phi1", "phi2", "w1", "w2", "T"), values, strict=True))

    def gap_events(self, until: ArrayLike) -> Value:
        """How often the gap has closed or opened by the time `until` in s; a graze of a flank is no event.

        >>> DirectStarts(J1=0.035, J2=0.175, c=368.465, gap=2, Ms=62, Mc=7.16, target_speed=92).gap_events(1)
        20.0
        """
        closed = np.ceil((until - self.first_contact) / self.period)
        opened = np.ceil((until - self.first_contact - self.contact_duration) / self.period)
        count = np.maximum(closed, 0) + np.maximum(opened, 0)
        return _plain(np.where(self.first_contact > 0, count, 0))


def _checked(**given: ArrayLike) -> tuple[Vector, ...]:
    """The arguments as float64 arrays; `InputError` with a sentence for each that is out of its range."""
    wrong: list[str] = []
    arrays: dict[str, Vector] = {}
    for name, value in given.items():
        try:
            array = arrays[name] = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            wrong.append(f"{name} = {value!r}: a number or an array of numbers is needed.")
            continue
        low, rule = (0, " and above 0") if name in ABOVE_ZERO else (-np.inf, "")
        bad = ~np.isfinite(array) | (array <= low)
        if name in NOT_NEGATIVE:
            bad, rule = ~np.isfinite(array) | (array < 0), " and 0 or more"
        if np.any(bad):
            where = [int(i) for i in np.argwhere(bad)[0]]
            wrong.append(f"{name}{where or ''} = {array[tuple(where)]:g}: must be finite{rule}.")
    if not wrong and arrays:
        try:
            np.broadcast_shapes(*(array.shape for array in arrays.values()))
        except ValueError:
            shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
            wrong.append(f"The arrays do not broadcast together; their shapes are {shapes}.")
    if wrong:
        raise InputError(wrong)
    return tuple(arrays.values())


def _reactive(kind: str, Mc: Vector) -> bool:
    """Whether the load is a reactive one, whose friction must oppose the motion."""
    if kind not in ("active", "reactive"):
        raise InputError(f'kind = {kind!r}: a load is "active" or "reactive".')
    if kind == "reactive" and np.any(Mc < 0):
        raise InputError(f"Mc = {np.min(Mc):g}: the torque of a reactive load in N m must be 0 or more.")
    return kind == "reactive"


def _approach(M1: Vector, J1: Vector, J2: Vector, Mc: Vector) -> Vector:
    """Relative acceleration of the free masses in rad/s2, under which the gap closes on the driving flank."""
    a = M1 / J1 + Mc / J2
    if np.any(a <= 0):
        raise InputError(
            f"M1/J1 + Mc/J2 = {np.min(a):g} rad/s2: the masses do not approach each other "
            "and the gap never closes; raise the motor torque of the open stage."
        )
    return a


def _peak(mean: Vector, impact: Vector) -> Vector:
    """`mean + sqrt(mean^2 + impact^2)` in N m, without cancellation where mean < 0."""
    amplitude = np.hypot(mean, impact)
    denominator = np.where(mean < 0, amplitude - mean, 1.0)
    return np.where(mean < 0, impact * (impact / denominator), mean + amplitude)


def _plain(value: Vector) -> float | Vector:
    return float(value) if np.ndim(value) == 0 else value


def _alike(*values: ArrayLike) -> tuple[Value, ...]:
    """Arrays of one shape, or Python floats where they have no dimensions."""
    return tuple(map(_plain, np.broadcast_arrays(*values)))
