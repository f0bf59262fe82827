"""A table that is wider than the page keeps its text columns."""

from __future__ import annotations

from softstart.views.numbers import Column, Table
from softstart.views.terminal import console, print_table


def test_a_wide_table_keeps_its_names(capsys) -> None:
    columns = [Column("law", False), *(Column(f"a heading of thirty letters, {i}") for i in range(5))]
    to = console()
    before = to.width
    print_table(to, Table("", columns, [["linear", *"12345"], ["exponential", *"67890"]]))
    shown = capsys.readouterr().out
    assert shown.splitlines()[0].startswith("law")
    assert "linear" in shown
    assert "exponential" in shown
    assert to.width == before
