"""The suite draws the same examples every time, whatever ran before in the same process."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st


def drawn() -> list[tuple[int, float]]:
    """Examples of one test, as the suite draws them."""
    found: list[tuple[int, float]] = []

    @settings(max_examples=200, derandomize=True, database=None)
    @given(st.integers(0, 10**6), st.floats(0.0, 1.0))
    def one(number: int, share: float) -> None:
        found.append((number, share))

    one()
    return found


def test_the_suite_draws_the_same_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a module with other numbers was loaded in between, which hypothesis would try on its own."""
    before = drawn()
    (tmp_path / "numbers_beside.py").write_text(f"NUMBERS = {list(range(1000, 1400))}\n")
    monkeypatch.syspath_prepend(tmp_path)
    import_module("numbers_beside")
    assert drawn() == before
