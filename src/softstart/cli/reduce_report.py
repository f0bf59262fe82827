"""The files of --out of `softstart reduce`."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from softstart import __version__
from softstart.views.markdown import markdown, markdown_table, write_table, write_text

if TYPE_CHECKING:
    from softstart.chain import Reduction
    from softstart.chain.simulation import Verification


def write_reduction(
    found: Reduction, beside: Reduction | None, done: Sequence[Verification], folder: Path, command: str
) -> None:
    """Scheme, figures, tables, the chain with all changes, what came out, and the report that ties them."""
    from softstart.chain.scheme import scheme_svg
    from softstart.cli.reduce import makes_drive
    from softstart.cli.reduce_text import chain_lines, conclusion, footnotes, tables
    from softstart.cli.reduce_verify import caution
    from softstart.views.drawing import save_figure

    vibration = found.whole_vibration
    write_text(folder / "scheme.svg", scheme_svg(found.chain))
    write_text(folder / "reduced-scheme.svg", scheme_svg(found.reduced))
    pictures = {"shapes": vibration.plot()}
    if any(step.ratio != float("inf") for step in found.steps):
        pictures["reduction"] = found.plot()
    for stem, figure in pictures.items():
        save_figure(figure, folder, stem)
    write_text(folder / "chain.toml", found.chain.to_toml())
    write_text(folder / "reduced.toml", found.reduced.to_toml())
    results = "[chain.toml](chain.toml), [reduced.toml](reduced.toml)"
    if makes_drive(found):
        write_text(folder / "drive.toml", found.to_drive().to_toml())
        results += ", [drive.toml](drive.toml) for compare, optimize and tune"
    _write_tables(found, folder)
    if done:
        rows = [{k: v for k, v in one.summary().items() if k != "chain"} for one in done]
        write_table(folder / "verified.csv", list(rows[0]), [list(row.values()) for row in rows])

    parts = [
        f"# {markdown(found.chain.name)}: natural frequencies and reduction",
        "\n".join(f"- {markdown(line.strip())}" for line in chain_lines(found.chain)[1:]),
        markdown(conclusion(found)),
        "![scheme](scheme.svg)",
        "![reduced scheme](reduced-scheme.svg)",
    ]
    for shown in tables(found, beside, done):
        headings = [" ".join(heading.split()) for heading in shown.headings]
        parts += [
            f"## {markdown(shown.title)}",
            markdown_table(headings, shown.rows, numbers_from=shown.texts),
        ]
    if said := caution(done):
        parts.append(markdown(said))
    parts += [f"![{stem}]({stem}.svg)" for stem in pictures]
    starts = ", [verified.csv](verified.csv)" if done else ""
    parts += [
        *map(markdown, footnotes(found)),
        f"What was reduced, and to what: {results}.",
        "All numbers: [frequencies.csv](frequencies.csv), [shapes.csv](shapes.csv), "
        "[holzer.csv](holzer.csv), [partial-systems.csv](partial-systems.csv), [steps.csv](steps.csv)"
        f"{starts}.",
        f"## Where this comes from\n\nsoftstart {__version__}, Python {platform.python_version()}, with "
        f"the command\n\n```sh\n{command}\n```\n\nSource: {markdown(found.chain.source) or 'none given'}.",
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def _write_tables(found: Reduction, folder: Path) -> None:
    vibration = found.whole_vibration
    names = [mass.name for mass in found.chain.masses]
    modes = range(vibration.Omega.size)
    write_table(
        folder / "frequencies.csv",
        ("mode", "Omega [rad/s]", "frequency [Hz]"),
        [[m, float(vibration.Omega[m]), float(vibration.frequency[m])] for m in modes],
    )
    write_table(folder / "shapes.csv", ("mode", *names), [[m, *vibration.shape[m].tolist()] for m in modes])
    rows = [[m, *row] for m in modes[1:] for row in vibration.holzer(m)]
    heading = ("mode", "mass", "inertia [kg*m^2]", "shape", "inertia torque [N*m]", "sum [N*m]")
    write_table(folder / "holzer.csv", (*heading, "stiffness [N*m/rad]", "twist [rad]"), rows)
    systems = [[s.kind, " + ".join(s.masses), s.Omega] for s in vibration.partial_systems]
    write_table(folder / "partial-systems.csv", ("kind", "masses", "Omega [rad/s]"), systems)
    kept = range(1, len(found.frequencies) + 1)
    columns = [f"{what} {i}" for i in kept for what in ("error", "bound")]
    steps = []
    for step in found.steps:
        errors = [x for pair in zip(step.errors, step.bounds, strict=False) for x in pair]
        filled = [*errors, *([None] * (len(columns) - len(errors)))]
        steps.append([step.kind, " + ".join(step.masses), step.Omega, step.ratio, step.masses_left, *filled])
    first = ("kind", "masses", "partial [rad/s]", "ratio", "masses left")
    write_table(folder / "steps.csv", (*first, *columns), steps)
