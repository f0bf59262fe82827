"""Designs on disk are those of python-control to the last bit, and never a stale or broken one."""

from __future__ import annotations

from pathlib import Path

import pytest

from softstart_controllers import shaft_observer
from softstart_controllers.design_store import kept


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "source.py"
    path.write_text("one", encoding="utf-8")
    return path


def refuse() -> list[float]:
    raise AssertionError("made again")


def test_a_design_is_made_once_and_read_back_exactly(source: Path, tmp_path: Path) -> None:
    numbers = [0.1, 1.0 / 3.0, -2.5e-300, 7.0]
    assert kept("a", source, lambda: numbers, tmp_path) == numbers
    assert kept("a", source, refuse, tmp_path) == numbers
    assert kept("b", source, lambda: [1.0], tmp_path) == [1.0]
    assert kept("a", source, refuse, tmp_path) == numbers


def test_another_source_is_another_design(source: Path, tmp_path: Path) -> None:
    kept("a", source, lambda: [1.0], tmp_path)
    source.write_text("two", encoding="utf-8")
    assert kept("a", source, lambda: [2.0], tmp_path) == [2.0]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"a": null}', '{"a": ["x"]}', "\x00"])
def test_a_broken_file_is_made_again(source: Path, tmp_path: Path, text: str) -> None:
    kept("a", source, lambda: [1.0], tmp_path)
    path = next(tmp_path.glob("source-designs-*.json"))
    path.write_text(text, encoding="utf-8")
    assert kept("a", source, lambda: [2.0], tmp_path) == [2.0]
    assert kept("a", source, refuse, tmp_path) == [2.0]


def test_without_a_place_to_write_it_still_works(source: Path, tmp_path: Path) -> None:
    assert kept("a", source, lambda: [1.0], tmp_path / "nowhere") == [1.0]


@pytest.mark.parametrize("steps", [-200, -120, -60])
def test_the_observer_gets_what_python_control_designs(steps: int) -> None:
    assert list(shaft_observer.design(steps)) == shaft_observer._designed(steps)
