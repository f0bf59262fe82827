"""The peer diffrax: a whole batch in one jitted, vmapped call, each stage ended by its root-finding Event.

A `while_loop` over phases, each a `diffeqsolve` (Tsit5, PID steps) ended by the earliest of its events. A
phase never begins on the surface that ends it: contact is cut at its peak (v = 0), the open gap where the
twist turns back, so nothing has to be masked. All events of a phase are one function, their smallest, since
of several that fall into one step diffrax takes the first listed and not the earliest. Newton finds the root.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from softstart_studies.benchmarks.problem import Line, Problem, Solve

TOLERANCE = 1e-8
T_MAX = 10.0  # s, never reached


def batch(problem: Problem, count: int) -> Solve:
    """All starts at once; compiled in the first pass."""
    jax = import_module("jax")  # optional, so it is imported by name: mypy must not need it
    jax.config.update("jax_enable_x64", True)
    lines = problem.lines(count)
    solved = jax.jit(jax.vmap(one_start(lines[0])))
    gaps = import_module("jax.numpy").asarray([float(line.gap[0]) for line in lines])
    return lambda: np.asarray(solved(gaps))[:, None]


def one_start(line: Line) -> Any:
    """The function gap -> peak torque, to be vmapped and jitted. Torque by stage only."""
    dfx, optx = import_module("diffrax"), import_module("optimistix")
    lax, jnp = import_module("jax.lax"), import_module("jax.numpy")
    (J1, J2), (c,), Mc = line.J.tolist(), line.c.tolist(), float(line.Mc[1])
    torques = jnp.array(line.stages())

    def rates(t: Any, y: Any, args: Any) -> Any:
        """theta, v, w2; `side` 0 is the open gap, else the flank in contact."""
        side, half, u = args[:3]
        T = jnp.where(side != 0, c * (y[0] - side * half), 0.0)
        a2 = (T - Mc) / J2
        return jnp.array([y[1], (u - T) / J1 - a2, a2])

    def guards(y: Any, args: Any) -> Any:
        """Positive until the phase ends: by the turn or what follows it, by the far flank, by the target."""
        side, half, _, inward, origin, reached = args
        contact = side != 0
        turn = jnp.where(contact, side, -origin) * y[1]
        after = jnp.where(contact, side * y[0] - half, half - origin * y[0])
        far = jnp.where(contact | ~inward, 1.0, half + origin * y[0])
        return jnp.stack([jnp.where(inward, turn, after), far, jnp.where(reached, 1.0, line.target - y[2])])

    event = dfx.Event(
        lambda t, y, args, **_: jnp.min(guards(y, args)), optx.Newton(1e-12, 1e-12), direction=False
    )
    options = {
        "saveat": dfx.SaveAt(t1=True),
        "stepsize_controller": dfx.PIDController(rtol=TOLERANCE, atol=TOLERANCE),
        "event": event,
        "max_steps": None,
        "adjoint": dfx.ForwardMode(),
        "throw": False,
    }
    term, solver = dfx.ODETerm(rates), dfx.Tsit5()

    def unfinished(carry: Any) -> Any:
        t, end = carry[0], carry[7]
        return t < end

    def phase(carry: Any, half: Any) -> Any:
        t, y, side, inward, origin, stage, reached, end, peak = carry
        args = (side, half, torques[jnp.minimum(stage, 3) - 1], inward, origin, reached)
        found = dfx.diffeqsolve(term, solver, t, end, None, y, args, **options)
        y, contact = found.ys[0], side != 0
        hit = found.result == dfx.RESULTS.event_occurred
        t = jnp.where(hit, found.ts[0], end)
        peak = jnp.where(contact, jnp.maximum(peak, c * jnp.abs(y[0] - side * half)), peak)
        which = jnp.where(hit, jnp.argmin(guards(y, args)), -1)
        turned = (which == 0) & inward
        opened = (which == 0) & ~inward & contact
        closed = ((which == 0) & ~inward & ~contact) | (which == 1)
        flank = jnp.where(which == 1, -origin, origin)
        end = jnp.where(which == 2, t + line.tail, end)
        # the state exactly on the surface that was met
        theta = jnp.where(opened, side * half, jnp.where(closed, flank * half, y[0]))
        y = y.at[0].set(theta).at[1].set(jnp.where(turned, 0.0, y[1]))
        origin = jnp.where(opened, side, origin)
        side = jnp.where(opened, 0.0, jnp.where(closed, flank, side))
        inward = jnp.where(turned, False, jnp.where(opened | closed, True, inward))
        stage = stage + jnp.where(opened | closed, 1, 0)
        return t, y, side, inward, origin, stage, reached | (which == 2), end, peak

    def start(gap: Any) -> Any:
        # from rest at mid-gap: outward to the driving flank
        carry = (0.0, jnp.zeros(3), 0.0, False, 1.0, 1, False, T_MAX, 0.0)
        carry = tuple(jnp.asarray(value) for value in carry)
        return lax.while_loop(unfinished, lambda carry: phase(carry, 0.5 * gap), carry)[8]

    return start
