"""Suggestions for unknown names: slips of the pen are understood, other words are not bent to a name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart import Chain, Drive, InputError, simulate
from softstart.controller import controller_names, make_controller
from softstart.drive import PARAMETERS
from softstart.hints import TERMS, did_you_mean, nearest, slips, term

NAMES = [*controller_names(), *PARAMETERS]
DOCS = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("a", "b", "wanted"),
    [("", "abc", 3), ("kitten", "sitting", 3), ("ab", "ba", 1), ("gap", "gap", 0), ("inertai", "inertia", 1)],
)
def test_slips_are_counted(a: str, b: str, wanted: int) -> None:
    """The textbook pair of Levenshtein, swaps, and both directions; never above the most that is asked."""
    assert slips(a, b, 9) == slips(b, a, 9) == wanted
    assert slips(a, b, 1) == min(wanted, 2)


@given(st.sampled_from(NAMES), st.data())
def test_one_slip_is_understood(name: str, data: st.DataObject) -> None:
    """A letter left out, put in, changed or swapped: the name itself, or one that is as near."""
    at = data.draw(st.integers(1, len(name) - 1))
    letter = data.draw(st.sampled_from("abcdefghijklmnopqrstuvwxyz"))
    slip = data.draw(
        st.sampled_from(
            [name[:at] + name[at + 1 :], name[:at] + letter + name[at:], name[:at] + letter + name[at + 1 :],
             name[: at - 1] + name[at] + name[at - 1] + name[at + 1 :]]
        )
    )  # fmt: skip
    found = nearest(slip, NAMES)
    assert found is not None
    assert slips(slip, found, 3) <= 1


@pytest.mark.parametrize("name", ["acceleration", "voltage", "torque_spread", "pole_pairs", "delta", "rotor"])
def test_another_word_is_not_bent_to_a_name(name: str) -> None:
    found = nearest(name, NAMES)
    assert found is None or name in found, "a part of one name"


@pytest.mark.parametrize(
    "word", ["star-delta", "Star Delta", "soft starter", "DOL", "V/f", "torque_speed", "VFD"]
)
def test_words_of_the_field_get_a_sentence(word: str) -> None:
    """As a controller and as a key of a file; each page that is named is there."""
    said = term(word)
    assert said is not None
    with pytest.raises(InputError) as told:
        make_controller(word)
    (sentence,) = told.value.sentences
    assert said in sentence
    assert "did you mean" not in sentence
    if re.fullmatch(r"\w+", word):
        for read in (
            lambda: Drive.load("crane-4amtkf").with_settings([f"motor.{word}=1"]),
            lambda: Drive.from_toml(
                Drive.load("crane-4amtkf").to_toml().replace("[motor]", f"[motor]\n{word} = 1")
            ),
            lambda: Chain.load("crane-4-mass", also={f"motor.{word}": 1}),
            lambda: Chain.load("crane-4-mass").with_values({word: 1.0}),
        ):
            with pytest.raises(InputError, match=re.escape(said)):
                read()


def test_pages_that_are_named_are_there() -> None:
    if not (DOCS / "docs").is_dir():
        pytest.skip("the documentation is not part of a wheel")
    for said in TERMS.values():
        for page in re.findall(r"docs/[\w/-]+\.md", said):
            assert (DOCS / page).is_file()


def test_several_names_are_several_suggestions() -> None:
    assert (
        did_you_mean("reduced", controller_names())
        == "did you mean reduced-first-stage or reduced-two-stage?"
    )
    with pytest.raises(InputError, match='did you mean "time"'):
        simulate("crane-4amtkf", "ramp", parameters={"tme": 0.1})
