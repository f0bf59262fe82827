"""What `softstart reduce` tells people: the chain, its frequencies, the steps, and what came out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.chain import Chain, Reduction
    from softstart.chain.simulation import Verification
    from softstart.chain.vibration import Vibration

MOST_MODES = 12


class Shown(NamedTuple):
    """A titled table: headings (with line breaks), cells, and how many columns from the left are text."""

    title: str
    headings: list[str]
    rows: list[list[str]]
    texts: int


def chain_lines(chain: Chain) -> list[str]:
    """The chain in a few lines."""
    from softstart.views.numbers import printable, short

    arrays = chain.at_motor_shaft()
    gaps = int((arrays.gap > 0.0).sum())
    lines = [
        printable(chain.name),
        f"  {len(chain.masses)} masses, {gaps} gap{'' if gaps == 1 else 's'}; at the motor shaft J = "
        f"{short(float(arrays.J.sum()))} kg m2, gaps {short(float(arrays.gap.sum()))} rad, load torque "
        f"{short(float(arrays.Mc.sum()))} N m",
        f"  motor on {chain.masses[arrays.motor].name}, load {chain.load_mass}",
    ]
    if chain.assumed:
        lines.append(f"  assumed: {printable(chain.assumed)}")
    return lines


def tables(found: Reduction, beside: Reduction | None, done: Sequence[Verification] = ()) -> list[Shown]:
    """Frequencies, steps, the two masses of both methods, and the starts on drive and chain."""
    shown = [frequencies_table(found.whole_vibration)]
    if found.steps:
        shown.append(steps_table(found))
    shown.append(kept_table(found))
    if len(found.reduced.masses) == 2:
        shown.append(two_masses_table(found, beside))
    if done:
        shown.append(verified_table(done))
    return shown


def frequencies_table(vibration: Vibration) -> Shown:
    """The lowest natural frequencies with their nodes."""
    from softstart.views.numbers import column_of

    count = min(vibration.Omega.size, MOST_MODES)
    nodes = [", ".join(f"{n.shaft + 1 + n.share:.2f}" for n in vibration.nodes[m]) for m in range(count)]
    rows = zip(
        [str(m) for m in range(count)],
        column_of([float(w) for w in vibration.Omega[:count]], 6),
        column_of([float(f) for f in vibration.frequency[:count]], 5),
        nodes,
        strict=True,
    )
    more = vibration.Omega.size - count
    title = "Natural frequencies, gaps closed" + (f" (and {more} above)" if more else "")
    listed = [[row[3] or "-", *row[:3]] for row in rows]
    return Shown(
        title,
        ["nodes (7.30: behind mass 7, at 0.30 of the twist to mass 8)", "mode", "Omega\nrad/s", "Hz"],
        listed,
        1,
    )


def steps_table(found: Reduction) -> Shown:
    """What went, at which frequency, and what it did to the kept frequencies."""
    from softstart.views.numbers import number

    what = {"joint": "rigid joint", "mass": "shared", "pair": "joined", "modal": "first mode of"}
    rows = []
    for step in found.steps:
        masses = ", ".join(step.masses) if step.kind != "modal" else "the chain"
        worst = max((abs(error) for error in step.errors), default=0.0)
        bound = max(step.bounds, default=0.0)
        rows.append(
            [
                f"{what[step.kind]} {masses}",
                number(step.Omega, 1),
                number(step.ratio, 1),
                str(step.masses_left),
                f"{100 * worst:.2g}",
                f"{100 * bound:.2g}" if math.isfinite(bound) else "-",
            ]
        )
    headings = ["step", "partial\nrad/s", "(partial/\nwanted)^2", "masses\nleft", "error\n%", "at most\n%"]
    wanted = f"wanted up to {found.wanted:.6g} rad/s, condition {found.factor:g}"
    return Shown(f"Steps, method {found.method}: {wanted}", headings, rows, 1)


def kept_table(found: Reduction) -> Shown:
    """The kept frequencies before and after."""
    rows = [
        [f"{i}", f"{f.whole:.6g}", f"{f.reduced:.6g}", f"{100 * f.error:+.3g}", f"{100 * f.bound:.3g}"]
        for i, f in enumerate(found.frequencies, start=1)
    ]
    return Shown(
        "Kept frequencies", ["mode", "chain\nrad/s", "reduced\nrad/s", "error\n%", "at most\n%"], rows, 0
    )


def two_masses_table(found: Reduction, beside: Reduction | None) -> Shown:
    """The chain and the two masses of both methods."""
    from softstart.views.numbers import short

    columns = [("chain", found.figures[0], None), (found.method, found.figures[1], found)]
    if beside is not None:
        columns.append((beside.method, beside.figures[1], beside))

    def cells(key: str) -> list[str]:
        return [short(getattr(figures, key)) for _, figures, _ in columns]

    def of_masses(at: str) -> list[str]:
        said = ["-"]
        for _, _, one in columns[1:]:
            assert one is not None
            chain = one.reduced
            index = chain.motor_index if at == "motor" else chain.load_index
            said.append(short(chain.masses[index].inertia))
        return said

    rows = [
        ["first elastic frequency, rad/s", *cells("Omega")],
        ["node: share of the twist before it", *cells("node")],
        ["participation of the motor", *cells("participation")],
        ["stiffness motor - load, N m/rad", *cells("stiffness")],
        ["J1, kg m2", *of_masses("motor")],
        ["J2, kg m2", *of_masses("load")],
        ["whole gap, rad", *cells("gap")],
    ]
    return Shown("Two masses", ["at the motor shaft", *(name for name, _, _ in columns)], rows, 1)


def verified_table(done: Sequence[Verification]) -> Shown:
    """The starts on the drive and on the chain; `which` stands in front, after the strategy."""
    from softstart.cli.reduce_verify import columns

    cells = columns(done)
    order = ["strategy", "which", *(name for name in cells if name not in ("strategy", "which"))]
    headings = ["largest in" if name == "which" else name for name in order]
    rows = [list(row) for row in zip(*(cells[name] for name in order), strict=True)]
    title = "Designed on the two masses, verified on the chain (K_dyn: the shaft beside the motor)"
    return Shown(title, headings, rows, 2)


def conclusion(found: Reduction) -> str:
    """What came out."""
    whole, after = len(found.chain.masses), len(found.reduced.masses)
    if not found.steps:
        return f"The {whole} masses stay: nothing swings far enough above {found.wanted:.6g} rad/s."
    worst = max(found.frequencies, key=lambda one: abs(one.error))
    said = (
        f"{whole} masses became {after}; of the kept frequencies {worst.whole:.6g} rad/s changed most, by "
        f"{100 * worst.error:+.3g} %."
    )
    if found.forced:
        said += f" The condition fails: its least ratio is {found.least_ratio:.3g}, below {found.factor:g}."
    return said


def footnotes(found: Reduction) -> list[str]:
    """What a reader must know."""
    notes = [note[0].upper() + note[1:] + "." for note in found.notes]
    if found.chain.assumed:
        notes.append(f"Assumed: {found.chain.assumed}.")
    return notes


def show_reduction(
    to: Console, found: Reduction, beside: Reduction | None, done: Sequence[Verification] = ()
) -> None:
    """All of it."""
    from softstart.cli.reduce_verify import caution
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(chain_lines(found.chain)):
        sentence(to, line, "bold" if index == 0 else "")
    for shown in tables(found, beside, done):
        to.print()
        columns = [Column(name, i >= shown.texts) for i, name in enumerate(shown.headings)]
        print_table(to, columns, shown.rows, title=shown.title)
    if said := caution(done):
        sentence(to, said, "bold")
    to.print()
    sentence(to, conclusion(found), "bold")
    for note in footnotes(found):
        sentence(to, note, "dim")
