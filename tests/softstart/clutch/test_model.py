"""Reading a clutch and its laws: all mistakes at once, in sentences with key, value, reason and remedy."""

from __future__ import annotations

import pytest

from softstart.clutch import Clutch, engage
from softstart.clutch.laws import read_law
from softstart.clutch.model import LIBRARY
from softstart.errors import InputError, SimulationError

PAPER = Clutch.load("paper-c")


def sentences(make):
    with pytest.raises(InputError) as caught:
        make()
    return caught.value.sentences


@pytest.mark.parametrize("name", LIBRARY.names())
def test_shipped_clutches_name_their_source_and_run(name):
    clutch = Clutch.load(name)
    assert clutch.source != "not given"
    assert engage(clutch).status == "LOCKED"
    assert Clutch.from_toml(clutch.to_toml()) == clutch


def test_all_mistakes_of_a_file_at_once():
    text = PAPER.to_toml().replace("230.0", '"50 Hz"').replace("gap = 0.0", "gapp = 0.1") + "\n[cluch]\nx = 1"
    found = sentences(lambda: Clutch.from_toml(text, where="my.toml"))
    assert len(found) == 4
    assert all(one.startswith("my.toml: ") for one in found)
    for words in (
        "did you mean [clutch]?",
        "[cluch] x = 1: [clutch] has no key x",
        "did you mean gap?",
        'write "50 turn/s" or "50 rad/s"',
    ):
        assert any(words in one for one in found), found


REFUSED = {
    "weak clutch": ({"load_torque": 600.0}, "load_torque = 600: the clutch holds 588.399 N m and"),
    "no inertia": ({"load_inertia": 0.0}, "load_inertia = 0.0: the inertia Ic of the load must be above 0"),
    "table without points": ({"law": "table"}, "there are 0 and 0 values; a table has a torque"),
    "points without table": ({"law_times": [0, 1]}, 'only the law "table" has law_times'),
    "late table": (
        {"law": "table", "law_times": [0.1, 1], "law_torques": [0, 588]}, "begins at 0 s, and its"
    ),
    "table goes back": (
        {"law": "table", "law_times": [0, 1, 0.5], "law_torques": [0, 1, 588]}, "its instants do not go back"
    ),
    "table too strong": (
        {"law": "table", "law_times": [0, 1], "law_torques": [0, 700]}, "law_torques[1] = 700: more than the"
    ),
    "a step for a law": ({"law": "exponential", "time_constant": 1e-4}, "more than 500 of these"),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_each_mistake_has_its_sentence(kind):
    changes, words = REFUSED[kind]
    found = sentences(lambda: PAPER.replace(**changes))
    assert len(found) == 1, found
    assert words in found[0]


def test_bad_ends_are_refused():
    assert "above 0 s" in sentences(lambda: engage(PAPER, until=0.0))[0]
    assert "until" in sentences(lambda: engage(PAPER, until="soon"))[0]


def test_too_long_a_run_is_given_up_and_not_cut_short(monkeypatch):
    monkeypatch.setattr("softstart.clutch.engagement.MOST_STEPS", 10)
    with pytest.raises(SimulationError, match=r"aborted at .* after 10 steps"):
        engage(PAPER)


def test_a_law_is_read_with_its_units(tmp_path):
    file = tmp_path / "law.csv"
    file.write_text("t [ms],M [kgf*m]\n0,0\n500,30\n500,40\n1000,60\n")
    times, torques = read_law(file)
    assert times == [0.0, 0.5, 0.5, 1.0]
    assert torques == pytest.approx([0.0, 294.1995, 392.266, 588.399])
    file.write_text("0,0\n1,588\n")
    assert read_law(file) == ([0.0, 1.0], [0.0, 588.0])


BAD_LAWS = {
    "three columns": ("0,1,2\n", 'line 1, "0,1,2", has 3 values instead of 2'),
    "word": ("0,0\n1,much\n", 'line 2, torque = "much": this is not a number'),
    "unit": ("t [m],M\n1,2\n", "m is a length, not a time"),
}


@pytest.mark.parametrize("kind", BAD_LAWS)
def test_a_bad_law_has_its_sentence(kind, tmp_path):
    text, words = BAD_LAWS[kind]
    file = tmp_path / "law.csv"
    file.write_text(text)
    assert words in sentences(lambda: read_law(file))[0]
    assert "there is no such file" in sentences(lambda: read_law(tmp_path / "none.csv"))[0]
