"""Every public name is documented in numpydoc sections: units, shapes, errors, an example, the source."""

from __future__ import annotations

import enum
import importlib.util
import inspect
import re
import runpy
from pathlib import Path

import pytest

import softstart

SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
FUNCTIONS = [name for name in softstart.__all__ if inspect.isfunction(getattr(softstart, name))]
CLASSES = [name for name in softstart.__all__ if inspect.isclass(getattr(softstart, name))]
DOCS = Path(__file__).parent.parent / "docs"
FURTHER = runpy.run_path(str(DOCS / "_ext" / "further_reading.py"))  # the pages about each module
# raised by softstart: their text is all they have, and no paper is its source
ERRORS = {"InfeasibleError", "InputError", "OptimumError", "SimulationError"}
# others are returned, not called by users
MADE_BY_USERS = {"Chain", "Clutch", "Command", "Drive", "Engine", "PeriodicTorque"}
MADE_BY_USERS |= {"Problem", "TorqueProfile"}


def sections(name: str) -> dict[str, str]:
    """Text of each section of the docstring; what stands before the first one has the name ''."""
    parts = SECTION.split(inspect.getdoc(getattr(softstart, name)) or "")
    return dict(zip(["", *parts[1::2]], parts[0::2], strict=True))


def documented(text: str) -> set[str]:
    """Names of the entries of a section of parameters."""
    names = re.findall(r"^\*{0,2}([\w, *]+?) :", text, re.MULTILINE)
    return {one.strip(" *") for group in names for one in group.split(",")}


@pytest.mark.parametrize("name", softstart.__all__)
def test_summary_and_example(name: str) -> None:
    found = sections(name)
    first = found[""].strip().split("\n")[0]
    assert first.endswith("."), f"{name}: the first line is one sentence"
    assert ">>>" in found.get("Examples", ""), f"{name}: no example under Examples"
    if name not in ERRORS:
        pages = FURTHER["pages_of"](getattr(softstart, name).__module__)
        assert pages or found.get("References", "").strip(), f"{name}: neither page nor References"


def test_pages_about_modules_exist() -> None:
    assert [module for module in FURTHER["PAGES"] if importlib.util.find_spec(module) is None] == []
    assert [
        page for pages in FURTHER["PAGES"].values() for page in pages if not (DOCS / f"{page}.md").exists()
    ] == []


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_tell_parameters_returns_and_errors(name: str) -> None:
    found = sections(name)
    parameters = set(inspect.signature(getattr(softstart, name)).parameters)
    assert documented(found.get("Parameters", "")) == parameters
    assert found.get("Returns", "").strip(), f"{name}: what it returns"
    assert "Error" in found.get("Raises", ""), f"{name}: which errors it raises, and when"


@pytest.mark.parametrize("name", sorted(set(CLASSES) - ERRORS))
def test_classes_tell_their_parameters_or_attributes(name: str) -> None:
    cls = getattr(softstart, name)
    found = sections(name)
    if issubclass(cls, enum.Enum):
        return
    told = documented(found.get("Parameters", "")) | documented(found.get("Attributes", ""))
    assert told, f"{name}: neither Parameters nor Attributes"
    if name in MADE_BY_USERS:
        parameters = set(inspect.signature(cls).parameters) - {"self", "values", "kwargs"}
        assert parameters <= told, f"{name}: not documented: {', '.join(sorted(parameters - told))}"
        assert "Error" in found.get("Raises", ""), f"{name}: which errors it raises, and when"
