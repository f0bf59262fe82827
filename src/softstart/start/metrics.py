"""The figures by which starts are judged: K_dyn, settling time, energy balance.

Every K_dyn comes from `formulas.dynamic_coefficient`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart import formulas
from softstart.arrays import Matrix, Vector
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.plant import layout as at

if TYPE_CHECKING:
    from scipy import optimize
else:
    optimize = late("scipy.optimize")


class Settling(Protocol):
    """What is needed of a start of a drive or a chain to say when its load has settled."""

    @property
    def drive(self) -> Any: ...
    @property
    def start_time(self) -> float: ...
    @property
    def end_time(self) -> float: ...
    @property
    def elastic_period(self) -> float: ...
    def load_at(self, times: ArrayLike) -> tuple[Vector, Vector]: ...


class Recorded(Protocol):
    """What is needed of a recorded start; `softstart.start.run.Run` has it."""

    @property
    def drive(self) -> Drive: ...
    @property
    def base(self) -> Drive: ...
    @property
    def segments(self) -> Matrix: ...
    @property
    def stages(self) -> Any: ...
    @property
    def start_time(self) -> float: ...
    @property
    def end_time(self) -> float: ...
    def at(self, times: ArrayLike) -> dict[str, Vector]: ...
    def states_in(self, segment: NDArray[np.int64], times: Vector) -> dict[str, Vector]: ...


REFERENCE = "direct"  # the strategy beside which start times and lives of the others stand
# settling is looked for at this many points an elastic period, then located
POINTS_PER_PERIOD = 64
# share of the target speed by which a load that has settled may still be below it
SETTLED_BAND = 0.001
# Gauss-Legendre on pieces of at most an eighth of the elastic period: 2e-14 of the swing and better
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
PIECES_PER_PERIOD = 8.0
GRADED = 60  # more pieces than there are behind an event
AT_ONCE = 100_000  # instants, or pieces, that are evaluated together


def base_torque(drive: Drive) -> Any:
    """M12avg_base = (Ms J2 + J1 Mc)/(J1 + J2) in N m, [G](16): the mean shaft torque under full torque.

    What the Coulomb friction of the motor takes does not reach the shaft: Ms - friction stands for Ms.
    Viscous friction is left out, it is zero as the motion begins: K_dyn does not depend on the target speed.

    >>> crane = Drive.load("crane-4amtkf")
    >>> round(base_torque(crane), 2), round(base_torque(crane.replace(motor_friction=6.0)), 2)
    (52.86, 47.86)
    """
    return ((drive.Ms - drive.motor_friction) * drive.J2 + drive.J1 * drive.Mc) / (drive.J1 + drive.J2)


def k_dyn(peak_torque: Any, drive: Drive) -> Any:
    """Dynamic coefficient K_dyn = peak |T| / M12avg_base, [G](16); `drive` gives the base.

    >>> round(k_dyn(105.72, Drive.load("crane-4amtkf")), 3)
    2.0
    """
    return formulas.dynamic_coefficient(peak_torque, base_torque(drive))


def settling_time(run: Recorded, band: float) -> float:
    """First instant from which |T - M12avg(u)| <= band * M12avg_base holds with the gap closed, s.

    M12avg(u) is the torque under which both masses gain speed alike, friction included.
    It must hold for one elastic period at least, to the end of the run; NaN otherwise.
    Scanned at 64 points an elastic period, the crossing itself located by root finding.
    """
    if not 0.0 < band < math.inf:
        raise InputError(f"band = {band}: the settling band is a share of the mean torque above 0, e.g. 0.1.")
    drive = run.drive
    if not run.stages or run.stages[-1].side == 0:
        return math.nan
    limit = band * float(base_torque(run.base))

    def excess(times: float | np.ndarray) -> np.ndarray:
        state = run.at(times)
        motor = state["u"] - drive.motor_friction - drive.motor_viscous_friction * state["w1"]
        load = drive.Mc + drive.load_viscous_friction * state["w2"]
        return np.abs(state["T"] - formulas.mean_shaft_torque(motor, drive.J1, drive.J2, load)) - limit

    begin = run.stages[-1].start
    period = float(drive.elastic_period)
    if run.end_time - begin < period:
        return math.nan  # too short to be called settled
    count = max(2, math.ceil((run.end_time - begin) / period * POINTS_PER_PERIOD))
    grid = np.linspace(begin, run.end_time, count)
    for end in range(count, 0, -AT_ONCE):  # from the end: what has not settled is found at once
        part = max(0, end - AT_ONCE)
        outside = np.flatnonzero(excess(grid[part:end]) > 0.0)
        if outside.size:
            last = part + int(outside[-1])
            break
    else:
        return float(begin)
    if last == count - 1 or run.end_time - grid[last + 1] < period:
        return math.nan
    if excess(grid[last + 1]) == 0.0:
        return float(grid[last + 1])
    return float(optimize.brentq(lambda time: float(excess(time)), grid[last], grid[last + 1], xtol=1e-12))


def settled_time(run: Settling, band: float = SETTLED_BAND) -> float:
    """First instant, not before the start time, from which on the load keeps its speed, s.

    It keeps it where w2 >= (1 - band) target to the end of the run; NaN if it is below at the end. The start
    time is a first passage: of two loads that swing, the one that swings further is there first, and falls
    back. This is the settling time of control engineering with three changes:

    - The band is one-sided, as the torque of a start goes on beyond the target speed, where a speed
      controller takes over.
    - It does not begin before the start time, so that both may be compared.
    - It is 0.1 %, not the usual 2 %: enough for rounding and for a load that creeps to its speed. Swings of
      the load speed are smaller than those of the torque. On the crane drive of [G] `reduced-first-stage` is
      7 ms quicker than direct start by its first passage; its load then falls back by 0.5 %, and has settled
      21 ms later than with direct start.

    The shaft torque has no part in it: undamped it swings for all time under every strategy
    (`settling_time` is for damped drives), and its size is what K_dyn judges. The lowest speeds lie where the
    shaft torque passes that of the load; they and the crossing are located in the closed forms.
    """
    drive, start = run.drive, run.start_time
    if math.isnan(start):
        return math.nan
    floor = (1.0 - band) * float(drive.target_speed)

    def over(times: Any) -> Any:
        return run.load_at(times)[0] - floor

    def push(times: Any) -> Any:
        return run.load_at(times)[1]

    count = math.ceil((run.end_time - start) / run.elastic_period * POINTS_PER_PERIOD)
    grid = np.linspace(start, run.end_time, max(2, count))
    pushed = push(grid)
    turns = np.flatnonzero((pushed[:-1] < 0.0) & (pushed[1:] >= 0.0))
    lowest = [
        optimize.brentq(lambda time: float(push(time)), grid[i], grid[i + 1], xtol=1e-12) for i in turns
    ]
    instants = np.union1d(grid, lowest)
    below = np.flatnonzero(over(instants) < 0.0)
    if below.size == 0:
        return start
    last = int(below[-1])
    if last == instants.size - 1:
        return math.nan
    ends = instants[last], instants[last + 1]
    return float(optimize.brentq(lambda time: float(over(time)), *ends, xtol=1e-12))


@dataclass(frozen=True)
class Energy:
    """Where the energy went, J; `residual` is what the sum misses and shows the accuracy of the run.

    motor = kinetic + elastic + load + dissipated + residual, all counted from the start of the run.
    """

    motor: float
    load: float
    kinetic: float
    elastic: float
    dissipated: float
    residual: float


def energy_balance(run: Recorded) -> Energy:
    """Motor work = kinetic + elastic + work against the load + dissipated + residual.

    Motor work int u w1 dt, load work int Mc' w2 dt (Mc' opposes motion when reactive), dissipated
    int (T - c z) z' dt in contact plus what the spring still holds when the flanks part at z > 0, and what
    friction of the motor and viscous friction of the load take. The
    residual is computed, not assumed: it shows how exact the run is.
    """
    drive, rows = run.drive, run.segments
    scale = float(drive.elastic_period) / PIECES_PER_PERIOD
    fastest = 1.0 / scale
    if drive.d > 0.0:
        fastest = max(fastest, float(drive.d * (1.0 / drive.J1 + 1.0 / drive.J2)))
    if drive.torque_lag > 0.0:
        fastest = max(fastest, 1.0 / float(drive.torque_lag))
    friction, b1, b2 = drive.frictions
    fastest = max(fastest, float(b1 / drive.J1), float(b2 / drive.J2))
    work = np.zeros(3)
    pieces = np.ceil((rows[:, at.S_END] - rows[:, at.S_START]) / scale) + GRADED
    turn = np.cumsum(pieces) // AT_ONCE  # spans are taken in turns of so many pieces: memory is bounded
    for part in np.split(np.arange(rows.shape[0]), np.flatnonzero(np.diff(turn)) + 1):
        starts, ends, owner = _pieces(rows[part], scale, 0.5 / fastest)
        owner += part[0]
        half = 0.5 * (ends - starts)
        times = starts[:, None] + half[:, None] * (NODES + 1.0)
        states = run.states_in(owner[:, None] + np.zeros(NODES.size, dtype=np.int64), times)
        side, load = rows[owner, at.S_SIDE][:, None], rows[owner, at.S_LOAD][:, None]
        motor = rows[owner, at.S_MOTOR][:, None]
        z = np.where(side != 0.0, side * states["theta"] - 0.5 * drive.gap, 0.0)
        spring = side * drive.c * z
        powers = (
            states["u"] * states["w1"],
            load * drive.Mc * states["w2"],
            (states["T"] - spring) * states["v"]
            + (motor * friction + b1 * states["w1"]) * states["w1"]
            + b2 * states["w2"] ** 2,
        )
        work += [np.sum(half * (power @ WEIGHTS)) for power in powers]
    supplied, against_load, dissipated = work.tolist()
    dissipated += _lost_at_parting(run)
    kinetic = _kinetic(run, run.end_time) - _kinetic(run, 0.0)
    elastic = _elastic(run, -1) - _elastic(run, 0)
    residual = supplied - kinetic - elastic - against_load - dissipated
    return Energy(supplied, against_load, kinetic, elastic, dissipated, residual)


def _pieces(rows: at.Matrix, scale: float, shortest: float) -> tuple[at.Vector, at.Vector, NDArray[np.int64]]:
    """Pieces (start, end, span): short behind each event, while damping and lag decay; even then."""
    growth = 1.5
    count = max(1, math.ceil(math.log(scale / shortest) / math.log(growth))) if shortest < scale else 0
    graded = shortest * (growth ** np.arange(count + 1) - 1.0) / (growth - 1.0)
    length = rows[:, at.S_END] - rows[:, at.S_START]
    edges = np.minimum(graded, length[:, None])
    rest = length - edges[:, -1]
    even = np.ceil(rest / scale).astype(np.int64)
    owner = np.repeat(np.arange(rows.shape[0]), even)
    within = np.arange(owner.size) - np.repeat(np.cumsum(even) - even, even)
    step = rest[owner] / even[owner]
    begin = rows[:, at.S_START]
    starts = np.concatenate(
        [(begin[:, None] + edges[:, :-1]).ravel(), (begin + edges[:, -1])[owner] + within * step]
    )
    lengths = np.concatenate([np.diff(edges, axis=1).ravel(), step])
    owners = np.concatenate([np.repeat(np.arange(rows.shape[0]), count), owner])
    return starts, starts + lengths, owners


def _kinetic(run: Recorded, time: float) -> float:
    state = run.at(time)
    return float(0.5 * run.drive.J1 * state["w1"] ** 2 + 0.5 * run.drive.J2 * state["w2"] ** 2)


def _elastic(run: Recorded, which: int) -> float:
    row = run.segments[which]
    if row[at.S_SIDE] == 0.0:
        return 0.0
    theta = run.at(run.end_time)["theta"] if which == -1 else row[at.S_THETA]
    z = row[at.S_SIDE] * theta - 0.5 * run.drive.gap
    return float(0.5 * run.drive.c * z * z)


def _lost_at_parting(run: Recorded) -> float:
    """Spring energy at the instants at which the torque vanishes though the flanks overlap."""
    rows = run.segments
    parts = np.flatnonzero((rows[:-1, at.S_SIDE] != 0.0) & (rows[1:, at.S_SIDE] == 0.0))
    z = np.abs(rows[parts + 1, at.S_THETA]) - 0.5 * run.drive.gap
    joins = np.flatnonzero((rows[:-1, at.S_SIDE] == 0.0) & (rows[1:, at.S_SIDE] != 0.0))
    back = np.abs(rows[joins + 1, at.S_THETA]) - 0.5 * run.drive.gap
    return float(0.5 * run.drive.c * (np.sum(z**2) - np.sum(back**2)))
