"""What the parts of a chain say against one another, and what the chain leaves out."""

from __future__ import annotations

import math
from collections.abc import Iterator

from softstart.chain.elements import ChainParts, Mass, Motor, Shaft
from softstart.errors import Sentence
from softstart.hints import nearest
from softstart.quantities import show

BRANCHES = (
    "A mass with more than two shafts, a branched train, is not covered: add a stiff branch (its inertia "
    "times the square of its speed ratio) to the mass that it leaves, or make one of equal branches, whose "
    "inertias, stiffnesses and torques add (docs/howto/reduce-a-driveline.md)."
)


def no_such_mass(place: str, names: list[str]) -> str:
    """The sentence on a mass that a chain with these masses does not have, and the nearest name."""
    meant = nearest(place, names)
    hint = f"did you mean {show(meant)}?" if meant else f"its masses are {', '.join(map(show, names))}."
    return f"the chain has no mass of this name; {hint}"


def mistakes_of(
    masses: tuple[Mass, ...], shafts: tuple[Shaft, ...], motor: Motor | None, load_mass: str
) -> list[str]:
    """What the parts of a chain say against one another."""
    wrong = []
    if len(masses) < 2:
        wrong.append(f"mass: a chain has at least 2 masses, and there are {len(masses)}.")
    elif len(shafts) != len(masses) - 1:
        wrong.append(
            f"shaft: {len(masses)} masses in a row are joined by {len(masses) - 1} shafts, and there are "
            f"{len(shafts)}. {BRANCHES}"
        )
    names = [mass.name for mass in masses]
    for name in sorted({name for name in names if names.count(name) > 1}):
        wrong.append(
            f"mass name = {show(name)}: {names.count(name)} masses have this name; give each its own."
        )
    if names and load_mass not in names:
        wrong.append(f"load = {show(load_mass)}: {no_such_mass(load_mass, names)}")
    if names and motor is not None and motor.mass not in names:
        wrong.append(f"[motor] mass = {show(motor.mass)}: {no_such_mass(motor.mass, names)}")
    held = [i for i, mass in enumerate(masses) if math.isinf(mass.inertia)]
    if not held or wrong:
        return wrong
    at_end = held == [0] or held == [len(masses) - 1]
    joint = shafts[0 if held[0] == 0 else -1]
    if not at_end:
        wrong.append("inertia = inf: one mass may stay at rest, the first or the last of the chain.")
    elif joint.rigid and joint.gap == 0.0:
        wrong.append("inertia = inf: a rigid joint without a gap holds its other mass too; leave that out.")
    if names[held[0]] == load_mass or (motor is not None and names[held[0]] == motor.mass):
        wrong.append(f"{show(names[held[0]])}: motor and load are on masses that move.")
    return wrong


def warnings_of(chain: ChainParts, load_torque: float) -> Iterator[str]:
    """Sentences on what a chain with this torque of all loads leaves out that decides its shaft torques."""
    for name in (mass.name for mass in chain.masses if math.isinf(mass.inertia)):
        yield f"{name} stays at rest: strategies are set up for the two masses of the chain without it."
    if chain.motor is not None and chain.motor.starting_torque <= load_torque:
        yield (
            "The starting torque is not above the load torque: K_dyn, which refers to it, says little. "
            "For a motor torque over speed see docs/howto/motor-torque-over-speed.md."
        )
    damped = any(one.damping or one.damping_ratio or one.efficiency < 1.0 for one in chain.shafts)
    inelastic = any(one.restitution is not None and one.restitution < 1.0 for one in chain.shafts)
    losses = damped or inelastic or any(mass.damping for mass in chain.masses)
    if not losses and any(shaft.gap > 0.0 for shaft in chain.shafts):
        yield Sentence(
            "This chain is undamped; late contacts of light masses determine the peaks.",
            "Give each shaft a damping_ratio (geared trains have 1 to 6 %).",
        )
