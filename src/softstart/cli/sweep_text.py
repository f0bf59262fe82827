"""What a sweep says on the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softstart.start.status import Status

if TYPE_CHECKING:
    import xarray
    from rich.console import Console

    from softstart.drive import Drive
    from softstart.sweeping.progress import Progress
    from softstart.sweeping.summary import Summary


def axis_summary(results: xarray.Dataset) -> dict[str, dict[str, Any]]:
    """The axes as plain data: how many values, from where to where or which."""
    found: dict[str, dict[str, Any]] = {}
    for dim in results.k_dyn.dims if "k_dyn" in results else results.status.dims:
        values = results[dim].values
        about: dict[str, Any] = {"count": int(values.size), "unit": results[dim].attrs.get("units", "")}
        if values.dtype.kind in "fiu":
            about |= {"from": float(values.min()), "to": float(values.max())}
        else:
            about["values"] = [str(value) for value in values]
        found[str(dim)] = about
    return found


def axis_columns(results: xarray.Dataset) -> dict[str, list[str]]:
    """The table of the axes."""
    columns: dict[str, list[str]] = {"axis": [], "values": [], "from": [], "to": [], "unit": []}
    for name, about in axis_summary(results).items():
        ends = [f"{about[end]:.6g}" if end in about else "-" for end in ("from", "to")]
        unit = about["unit"] or ", ".join(about.get("values", ()))
        for column, cell in zip(columns.values(), (name, f"{about['count']:,}", *ends, unit), strict=True):
            column.append(cell)
    return columns


def figure_columns(results: xarray.Dataset, summary: Summary) -> dict[str, list[str]]:
    """The table of the figures."""
    from softstart.views.numbers import column_of

    names = list(summary.spreads)
    rows = [
        column_of([spread.least, *spread.quantiles.values(), spread.most], 5)
        for spread in summary.spreads.values()
    ]
    headings = ["least", "5 %", "median", "95 %", "most"]
    cells = zip(*rows, strict=True)
    units = [str(results[name].attrs.get("units", "")) for name in names]
    return {
        "figure": names,
        "unit": ["" if unit == "1" else unit for unit in units],
        **{heading: list(column) for heading, column in zip(headings, cells, strict=True)},
    }


def conclusion(results: xarray.Dataset, summary: Summary) -> str:
    """Where the worst case sits, and what share came to its speed."""
    share = f"{summary.share_reached:.4g}" if summary.share_reached < 1.0 else "1"
    reached = (
        "All starts reached the target speed."
        if summary.share_reached == 1.0
        else f"A share of {share} of the starts reached the target speed."
    )
    if not summary.worst:
        return reached
    most = summary.spreads[summary.judged].most
    unit = results[summary.judged].attrs.get("units", "1")
    places = ", ".join(
        f"{name} {value if isinstance(value, str) else format(value, '.5g')}"
        for name, value in summary.worst.items()
    )
    name = "K_dyn" if summary.judged == "k_dyn" else summary.judged.replace("_", " ")
    return f"Largest {name} {most:.4g}{'' if unit == '1' else ' ' + unit} at {places}. {reached}"


def endings(summary: Summary) -> list[str]:
    """How the starts ended, where not all reached their target speed."""
    if set(summary.statuses) == {Status.REACHED.name}:
        return []
    return [f"{count:,} starts: {Status[name].value}" for name, count in summary.statuses.items()]


def pace(last: Progress | None) -> str:
    """How many starts were made, and how fast."""
    if last is None:
        return ""
    made = last.done - last.before
    said = f"{last.starts:,} starts"
    if last.before:
        said += f", of which {last.before:,} were finished before"
    if made and last.seconds > 0.0:
        said += f"; {made / last.seconds:,.0f} starts/s in {last.seconds:.1f} s"
    return said + "."


def show(
    to: Console,
    drive: Drive,
    fitted_to: Drive | None,
    results: xarray.Dataset,
    summary: Summary,
    last: Progress | None,
) -> None:
    """Print everything."""
    from softstart.cli.sweep_cells import MOST_SHOWN, cell_table
    from softstart.views.drives import controllers_set_up, drive_lines
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(drive_lines(drive)):
        sentence(to, line, "bold" if index == 0 else "")
    if fitted_to is not None:
        sentence(to, f"  {controllers_set_up(None, fitted_to)}")
    for title, columns, texts in (
        ("The grid", axis_columns(results), ("axis", "unit")),
        ("Over all starts", figure_columns(results, summary), ("figure", "unit")),
    ):
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        if rows:
            to.print()
            print_table(to, [Column(name, name not in texts) for name in columns], rows, title=title)
    if summary.starts <= MOST_SHOWN:
        headings, cells, _ = cell_table(results, to)
        to.print()
        print_table(to, [Column(name, _numbers(cells, i)) for i, name in enumerate(headings)], cells,
                    title="Each start")  # fmt: skip
    to.print()
    sentence(to, conclusion(results, summary), "bold")
    for note in (*endings(summary), pace(last)):
        if note:
            sentence(to, note, "dim")


def _numbers(cells: list[list[str]], column: int) -> bool:
    """Whether a column holds numbers, which are set to the right."""
    return not any(row[column][:1].isalpha() for row in cells)
