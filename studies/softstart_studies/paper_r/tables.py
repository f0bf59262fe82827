"""Tables 1 and 2 of [R]: what is printed, and what follows from it."""

from __future__ import annotations

from typing import NamedTuple

from softstart.study import Claim, Table

SECTIONS = ("12-13", "13-14", "14-15", "15-16", "16-17", "17-18")
BACKLASH, DIAMETER = 0.2e-3, 0.185  # m, the means of [R]
MESH = 0.002  # rad: 2 * 0.2/185 rounded as [R] does
MESHES = (1, 1, 1, 1, 2, 1)  # two meshes in section 16-17

# Table 1: speed of the section over that of the crank, by gear. The first 12-13 is printed as 1.708.
RATIOS: dict[int, tuple[float | None, ...]] = {
    1: (0.708, 0.708, 0.272, 0.0746, 0.0528, 0.0118),
    2: (0.708, 0.708, 0.315, 0.0864, 0.0612, 0.01375),
    3: (0.708, 0.708, 0.364, 0.100, 0.0709, 0.0159),
    4: (0.708, 0.708, 0.450, 0.1235, 0.1235, 0.0196),
    5: (None, None, 0.540, 0.1052, 0.1052, None),
    6: (None, None, 0.628, 0.122, 0.122, None),
    7: (None, None, 0.728, 0.142, 0.142, None),
    8: (None, None, 0.900, 0.174, 0.147, None),
}
# Table 2: gaps at the crank, rad, as printed; in gears 5 and 7 three figures whose columns are not clear.
PRINTED: dict[int, tuple[str, ...]] = {
    1: ("0.003", "0.003", "0.007", "0.027", "0.076", "0.169"),
    3: ("0.003", "0.003", "0.005", "0.020", "0.056", "0.126"),
}
PRINTED_BELOW: dict[int, tuple[str, str, str]] = {
    5: ("0.004", "0.019", "0.253"),
    7: ("0.003", "0.014", "0.192"),
}
SUM_RANGE = (0.02, 0.253)  # rad: "absolute gaps at the crank"
RESONANCE = 2.0  # deg: largest resonance amplitude at the crank nose, as [R] measured


class Cell(NamedTuple):
    """A cell of table 2: its place, the print, the number from table 1, and whether that gives the print.

    `follows` is "yes" where the number rounds to the print, "no" where table 1 cannot give it.
    """

    gear: int
    section: str
    printed: str
    recomputed: float | None
    follows: str


def gaps_of(gear: int) -> tuple[float | None, ...]:
    """Gaps of the sections of a gear at the crank in rad: 0.002 rad a mesh, over the speed ratio.

    >>> [round(gap, 4) for gap in gaps_of(1)]
    [0.0028, 0.0028, 0.0074, 0.0268, 0.0758, 0.1695]
    """
    return tuple(
        None if ratio is None else meshes * MESH / ratio
        for ratio, meshes in zip(RATIOS[gear], MESHES, strict=True)
    )


def cells() -> list[Cell]:
    """All cells of table 2 with what they follow from.

    >>> [cell.section for cell in cells() if cell.follows == "no"]
    ['?', '?']
    """
    found = []
    for gear, printed in PRINTED.items():
        for section, text, gap in zip(SECTIONS, printed, gaps_of(gear), strict=True):
            found.append(Cell(gear, section, text, gap, _follows(text, gap)))
    for gear, (first, second, third) in PRINTED_BELOW.items():
        gaps = gaps_of(gear)
        found.append(Cell(gear, "14-15", first, gaps[2], _follows(first, gaps[2])))
        found.append(Cell(gear, "15-16", second, gaps[3], _follows(second, gaps[3])))
        found.append(Cell(gear, "?", third, None, "no"))
    return found


def _follows(printed: str, value: float | None) -> str:
    if value is None:
        return "no"
    return "yes" if f"{value:.3f}" == printed else "no"


def recomputed_table() -> Table:
    """Table 2 beside what follows from table 1."""
    columns = ("gear", "section", "printed, rad", "recomputed, rad", "follows")
    return Table("Table 2 from table 1: gaps at the crank", columns, cells())


def claims() -> list[Claim]:
    """What becomes of the statements about gaps."""
    all_cells = cells()
    yes = sum(cell.follows == "yes" for cell in all_cells)
    lost = [cell for cell in all_cells if cell.follows == "no"]
    needed = {cell.gear: MESH / float(cell.printed) for cell in lost}
    exact = 2.0 * BACKLASH / DIAMETER
    first = [gap for gap in gaps_of(1) if gap is not None]
    degrees = 57.29577951308232
    large = [s for s, gap in zip(SECTIONS, first, strict=True) if gap * degrees > RESONANCE]
    return [
        Claim(
            "Table 2 follows from table 1 and a gap of 0.002 rad in each mesh",
            "partly",
            f"{yes} of {len(all_cells)} cells round to the print; {' and '.join(c.printed for c in lost)} "
            "of gears 5 and 7 do not follow: as one mesh they would need i = "
            f"{' and '.join(f'{i:.4f}' for i in needed.values())}, which no gear has. 12-13 of gear 1 "
            "follows with 0.708; the 1.708 printed in table 1 would give 0.001.",
        ),
        Claim(
            "A backlash of 0.2 mm on 185 mm is an angular gap of 0.002 rad",
            "confirmed",
            f"2 * 0.2/185 = {exact:.5f} rad; rounding to 0.002 makes every gap "
            f"{100 * (1 - MESH / exact):.1f} % smaller. The copy at hand reads 185 cm, which would give a "
            "tenth.",
        ),
        Claim(
            "Gaps at the crank are 0.02 to 0.253 rad (1.5 to 15 deg)",
            "partly",
            f"0.02 rad are {0.02 * degrees:.2f} deg and 0.253 rad {0.253 * degrees:.1f} deg. Sections of "
            f"gear 1 have {min(first):.4f} to {max(first):.4f} rad, all of them together {sum(first):.3f} "
            f"rad ({sum(first) * degrees:.1f} deg).",
        ),
        Claim(
            "Gaps may exceed the largest resonance amplitudes at the crank nose (1.5 to 2 deg)",
            "confirmed",
            f"In gear 1 the sections {', '.join(large)} each exceed 2 deg ({RESONANCE / degrees:.3f} rad) "
            "on their own.",
        ),
    ]
