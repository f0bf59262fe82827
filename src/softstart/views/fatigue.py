"""How long a shaft line lasts, in words, tables, a figure and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.drive import Drive
from softstart.start.fatigue import HOURS_PER_YEAR, Fatigue, Life
from softstart.start.metrics import REFERENCE
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    MARKERS,
    drawing,
    entitle,
    head,
    new_figure,
    save_figure,
)  # fmt: skip
from softstart.views.markdown import (
    file_stem,
    markdown,
    markdown_table,
    write_columns,
    write_drive_report,
    write_rows,
)  # fmt: skip
from softstart.views.numbers import Table, column_of, number, short

if TYPE_CHECKING:
    from softstart.chain.fatigue import ChainFatigue, ShaftLife

SPECTRUM = ("range N m", "mean N m", "count")
EQUIVALENT = (
    "Equivalent torque: one cycle of it from 0 and back in each start does the same damage "
    "(rainflow cycles after ASTM E1049, Miner's rule, without an endurance limit)."
)


def factor(value: float) -> str:
    """A life beside another one, three digits.

    >>> factor(101.29), factor(1.0), factor(0.0123), factor(math.inf), factor(math.nan), factor(16523.0)
    ('101', '1.00', '0.0123', 'inf', '-', '16500')
    """
    if math.isnan(value) or math.isinf(value) or value == 0.0:
        return number(value, 2)
    rounded = float(f"{value:.3g}")
    return number(rounded, max(0, 2 - math.floor(math.log10(rounded))))


def counted(value: float) -> str:
    """A number that may be large, three digits: 2730, 1.44e+09."""
    return f"{value:.3g}" if 1e6 <= value < math.inf else factor(value)


def fatigue_table(found: Fatigue, rows: Sequence[Life], title: str = "") -> Table:
    """The strategies and what they do to the shaft line."""
    cells = {
        "strategy": [row.run.controller_name for row in rows],
        "K_dyn": [number(row.run.k_dyn, 3) for row in rows],
        "start\ntime s": column_of([row.run.start_time for row in rows]),
        "equivalent\ntorque N m": column_of([row.equivalent_torque for row in rows]),
        "life over\ndirect": [factor(row.relative) for row in rows],
    }
    if found.estimate:
        cells["half\ndamping"] = [factor(row.relative_range[0]) for row in rows]
        cells["twice\ndamping"] = [factor(row.relative_range[1]) for row in rows]
    if found.curve.points:
        cells["starts to\nfailure"] = [counted(row.starts) for row in rows]
        if found.drive.limits.starts_per_hour is not None:
            cells["years"] = [counted(row.years) for row in rows]
    if not math.isnan(found.worn_gap):
        cells["life over\ndirect, worn"] = [factor(row.worn_relative) for row in rows]
        if any(not math.isnan(row.worn_hours) for row in rows):
            cells["years,\nworn"] = [counted(row.worn_years) for row in rows]
    cells["impacts"] = [str(row.impacts) for row in rows]
    cells["their\nenergy J"] = column_of([row.impact_energy for row in rows], 3)
    return Table.of(title, cells, ("strategy",))


def conclusion(found: Fatigue) -> str:
    """Under which strategy the shaft line lasts longest."""
    reaching = [row for row in found.rows if not math.isnan(row.run.start_time)] or list(found.rows)
    worn = not math.isnan(found.worn_gap)
    best = max(reaching, key=lambda row: row.worn_relative if worn else row.relative)
    name = best.run.controller_name
    if name == REFERENCE:
        return "Longest life: direct while the gap wears." if worn else "Longest life: direct."
    values = {"name": name, "life": factor(best.worn_relative if worn else best.relative)}
    text = (
        "Longest life: {name}, {life} times that of direct while the gap wears".format(**values)
        if worn
        else "Longest life: {name}, {life} times that of direct".format(**values)
    )
    years = best.worn_years if worn else best.years
    return f"{text}." if math.isnan(years) else f"{text}, {counted(years)} years."


def notes(found: Fatigue) -> list[str]:
    """What the figures mean, and what they rest on."""
    drive, limits = found.drive, found.drive.limits
    if found.curve.slope is None:
        curve = f"The S-N curve has the {len(found.curve.points)} points of limits.fatigue."
    elif found.slope_given:
        curve = f"Slope of the S-N curve: m = {short(found.curve.slope)}."
    else:
        curve = (
            f"Slope of the S-N curve: m = {short(found.curve.slope)}, that of pitting of "
            "case-hardened gears (ISO 6336-2), as neither --slope nor limits.fatigue is given."
        )
    text = [f"{EQUIVALENT} {curve}"]
    ratio = f"{100.0 * found.damping_ratio:.2g} %"
    if found.estimate:
        parts = " and ".join(f"{count} {name}" for name, count in found.estimate.items())
        text.append(
            f"The damping is ESTIMATED: a ratio of {ratio} from {parts} (1 % a pair of gears, 0.5 % a "
            "coupling, at most 6 %). The columns beside show the life with half and with twice of it."
        )
    else:
        text.append(f"Damping ratio of the shaft: {ratio}.")
    if not math.isnan(found.worn_gap):
        error = max(row.wear_error for row in found.rows)
        values = {
            "new": short(float(drive.gap)),
            "worn": short(found.worn_gap),
            "error": f"{float(f'{100.0 * error:.1g}'):g}",
        }
        text.append(
            (
                "Worn: the gap grows in proportion to time from {new} to {worn} rad over the life, and "
                "Miner's rule adds the damage; error of the sum at most {error} %."
            ).format(**values)
            if limits.life is None
            else (
                "Worn: the gap grows in proportion to time from {new} to {worn} rad over {years:.3g} "
                "years, and Miner's rule adds the damage; error of the sum at most {error} %."
            ).format(years=limits.life / 3600.0 / HOURS_PER_YEAR, **values)
        )
    if limits.starts_per_hour is not None and found.curve.points:
        text.append(f"Years of 8766 h with {short(float(limits.starts_per_hour))} starts in each hour.")
    if limits.starts is not None and limits.starts_per_hour is not None and found.curve.points:
        asked, worn = limits.starts / limits.starts_per_hour, not math.isnan(found.worn_gap)
        names: dict[bool, list[str]] = {True: [], False: []}
        for row in found.rows:
            names[(row.worn_hours if worn else row.hours) >= asked].append(row.run.controller_name)
        kept = (
            f"The life asked for, {limits.starts:.3g} starts, is reached by: "
            f"{', '.join(names[True]) or 'none'}"
        )
        text.append(f"{kept}; not by: {', '.join(names[False])}." if names[False] else f"{kept}.")
    worst = [
        f"{row.run.controller_name} {row.run.position}" for row in found.rows if len(drive.positions) > 1
    ]
    if worst:
        text.append(f"The start position is unknown: most damage is done from {', '.join(worst)}.")
    return text


def chain_tables(found: ChainFatigue) -> list[Table]:
    """Each shaft under the strategies: equivalent torque, life, share of its permissible torque."""
    names = [row[0].run.controller_name for row in found.rows]
    shafts = found.chain.shaft_names

    def table(title: str, cell: Callable[[ShaftLife], str]) -> Table:
        columns = {name: [cell(row[k]) for row in found.rows] for k, name in enumerate(shafts)}
        return Table.of(title, {"strategy": names, **columns}, ("strategy",))

    tables = [
        table(
            "Damage-equivalent torque at the motor shaft, N m",
            lambda one: number(one.equivalent_torque, 1),
        ),
        table("Life over that under direct", lambda one: factor(one.relative)),
    ]
    if any(not math.isnan(life.used) for row in found.rows for life in row):
        tables.append(
            table("Largest torque, % of the permissible one", lambda one: number(100.0 * one.used, 1))
        )
    return tables


def chain_conclusion(found: ChainFatigue) -> str:
    """Under which strategy the shaft that gains least lasts longest."""
    least = [min(row, key=lambda life: life.relative) for row in found.rows]
    best = max(least, key=lambda life: life.relative)
    name = best.run.controller_name
    if name == REFERENCE:
        return "Longest life of the shaft that gains least: direct."
    shaft = found.chain.shaft_names[best.shaft]
    life = factor(best.relative)
    return f"Longest life: {name}; the shaft that gains least, {shaft}, has {life} times that under direct."


def chain_notes(found: ChainFatigue) -> list[str]:
    """What the figures mean, and what they rest on."""
    slope = short(found.slope)
    curve = (
        f"Slope of the S-N curve: m = {slope}."
        if found.slope_given
        else f"Slope of the S-N curve: m = {slope}, that of pitting of case-hardened gears (ISO 6336-2)."
    )
    text = [f"{EQUIVALENT} {curve}"]
    worst = [
        f"{row[0].run.controller_name} {', '.join(sorted({life.run.position for life in row}))}"
        for row in found.rows
        if len(found.chain.positions) > 1
    ]
    if worst:
        text.append(f"The start position is unknown: most damage is done from {'; '.join(worst)}.")
    return text


def write_chain_fatigue(found: ChainFatigue, folder: Path, command: str) -> None:
    """Table, report, and the turning points of each shaft under each strategy."""
    write_rows(folder / "fatigue.csv", [life.summary() for row in found.rows for life in row])
    stems: list[str] = []
    for row in found.rows:
        for life in row:
            stems.append(file_stem(f"{life.run.controller_name} shaft {life.shaft + 1}", stems))
            times, torques = life.turning_points.T.tolist()
            write_columns(
                folder / f"turning-points-{stems[-1]}.csv", {"time s": times, "torque N m": torques}
            )
    parts = [
        f"# {markdown(found.chain.name)}: life of its shafts",
        chain_conclusion(found),
        *(part for one in chain_tables(found) for part in (f"**{one.title}**", markdown_table(one))),
        *map(markdown, chain_notes(found)),
    ]
    write_drive_report(folder, parts, found.chain, command)


def fatigue_figure(found: Fatigue) -> Any:
    """Ranges of the cycles of a start over their number, and life beside that of direct."""
    rows = sorted(found.rows, key=lambda row: -row.relative)
    with drawing():
        figure, (left, right) = new_figure(1, 2, (9.0, 1.9 + 0.28 * max(6, len(rows))))
        for index, row in enumerate(rows):
            counts = np.concatenate([[0.5], np.cumsum(row.spectrum[:, 2])])
            ranges = np.concatenate([row.spectrum[:1, 0], row.spectrum[:, 0]])
            left.step(
                counts, ranges, where="pre", color=COLOURS[index % 8], ls=DASHES[index % 8],
                label=row.run.controller_name,
            )  # fmt: skip
        left.set_xscale("log")
        left.set_ylim(bottom=0.0)
        left.legend(fontsize=8)
        head(
            left,
            "cycles of one start",
            "range of the shaft torque, N m",
            "cycles of at least this range",
        )
        for index, row in enumerate(rows):
            if math.isfinite(row.relative):
                right.plot(
                    [row.relative], [index], MARKERS[index % len(MARKERS)], color=COLOURS[index % 8], ms=8
                )
        right.axvline(1.0, color=GREY, lw=0.8, ls=":")
        right.set_xscale("log")
        right.set_yticks(range(len(rows)), [row.run.controller_name for row in rows])
        right.invert_yaxis()
        slope = "" if found.curve.slope is None else f", m = {short(found.curve.slope)}"
        damping = (
            f"damping ratio {100.0 * found.damping_ratio:.2g} % (estimated)"
            if found.estimate
            else f"damping ratio {100.0 * found.damping_ratio:.2g} %"
        )
        head(right, f"{damping}{slope}", "", "life over that of direct")
        entitle(figure, found.drive.name)
    return figure


def write_fatigue(found: Fatigue, folder: Path, command: str, fitted_to: Drive | None) -> None:
    """Everything about these lives: figure, table, and for each strategy its spectrum and turning points."""
    save_figure(found.plot(), folder, "fatigue")
    stems: list[str] = []
    for row in found.rows:
        stems.append(file_stem(row.run.controller_name, stems))
        columns = dict(zip(SPECTRUM, row.spectrum.T.tolist(), strict=True))
        write_columns(folder / f"spectrum-{stems[-1]}.csv", columns)
        times, torques = row.turning_points.T.tolist()
        write_columns(
            folder / f"turning-points-{stems[-1]}.csv", {"time s": times, "shaft torque N m": torques}
        )
    write_rows(
        folder / "fatigue.csv",
        [
            {k: v for k, v in row.summary().items() if k not in {"spectrum", "relative_life_range"}}
            for row in found.rows
        ],
    )
    parts = [
        f"# {markdown(found.drive.name)}: life of the shaft line",
        conclusion(found),
        markdown_table(fatigue_table(found, found.rows)),
        *map(markdown, notes(found)),
        "![life](fatigue.svg)",
        "Cycles: " + ", ".join(f"[{stem}](spectrum-{stem}.csv)" for stem in stems) + ".",
    ]
    write_drive_report(folder, parts, found.drive, command, fitted_to)
